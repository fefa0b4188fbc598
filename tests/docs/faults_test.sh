#!/usr/bin/env bash
# Breaks a copy of the book in one way after the other: each fault must be found by its check, with the
# words that name it. Usage: faults_test.sh ROOT FOLDER_OF_PROGRAMS
set -uo pipefail
root=$(cd "$1" && pwd) bin=$(cd "$2" && pwd)
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
failed=0
export HELP_TEXTS=$copy/help
mkdir "$HELP_TEXTS"

fresh() {
  rm -rf "$copy/docs"
  cp "$root"/{README,CONTRIBUTING}.md "$copy"
  cp -r "$root/docs" "$copy"
}
# Sources are only read.
for folder in server client common proto tests deploy CMakeLists.txt LICENSE; do
  ln -s "$root/$folder" "$copy/$folder"
done

# expect CHECK WORDS: the check fails and says so.
expect() {
  local said
  if said=$(bash "$root/tests/docs/check_docs.sh" "$1" "$copy" "$bin"); then
    printf '%s: a fault was not found: %s\n' "$1" "$2"
    failed=1
  elif ! grep -qF -- "$2" <<<"$said"; then
    printf '%s: wanted "%s", got:\n%s\n' "$1" "$2" "$(head -n 5 <<<"$said")"
    failed=1
  fi
}

fresh; printf '\n[gone](nowhere.md)\n' >>"$copy/docs/limits.md"
expect links 'link to nowhere.md: there is no such file'
fresh; printf '\n[gone](docs/limits.md#no-such-heading)\n' >>"$copy/README.md"
expect links 'docs/limits.md has no such heading'
fresh; printf '\nSee `server/nowhere/at_all.cpp`.\n' >>"$copy/docs/limits.md"
expect links 'names server/nowhere/at_all.cpp'
fresh; printf '\nAsk for `Coupling::Nowhere`.\n' >>"$copy/CONTRIBUTING.md"
expect links 'names Coupling::Nowhere, which no source has'
fresh; printf '# Alone\n' >"$copy/docs/alone.md"
expect links 'no page leads to docs/alone.md'
fresh; yes 'A line.' | head -n 200 >>"$copy/README.md"
expect style 'allowed are 150'
fresh; { printf '\n'; yes word | head -n 91 | tr '\n' ' '; printf '\n'; } >>"$copy/docs/limits.md"
expect style 'a paragraph of 91 words'
fresh; head -c 150001 /dev/zero >"$copy/docs/pictures/large.jpg"
expect style 'large.jpg: has 150001 bytes'
fresh; sed -i '/^| `fibre_direction`/d' "$copy/docs/scripts-and-scenarios.md"
expect keys 'does not have the key fibre_direction'
fresh; sed -i 's/^| `fibre_direction`/| `fiber_direction`/' "$copy/docs/scripts-and-scenarios.md"
expect keys 'has the key fiber_direction, which nothing reads'
fresh; sed -i '/^| `--organ/d' "$copy/docs/programs.md"
expect options "'## trocar-server' does not have --organ"
fresh; sed -i '0,/^| `--organ/s//| `--orgn/' "$copy/docs/programs.md"
expect options "'## trocar-server' has --orgn, which trocar-server does not have"
fresh; printf '\nUse `--no-such-option`.\n' >>"$copy/docs/limits.md"
expect options 'docs/limits.md: names --no-such-option'
exit $failed
