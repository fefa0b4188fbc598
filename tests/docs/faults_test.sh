#!/usr/bin/env bash
# Breaks a copy of the book in every way at once: each fault must be found by its check, with the words that
# name it. Usage: faults_test.sh ROOT FOLDER_OF_PROGRAMS
set -uo pipefail
root=$(cd "$1" && pwd) bin=$(cd "$2" && pwd)
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
failed=0

cp "$root"/{README,CONTRIBUTING}.md "$copy"
cp -r "$root/docs" "$copy"
# Sources are only read.
for folder in server client common proto tests deploy CMakeLists.txt LICENSE; do
  ln -s "$root/$folder" "$copy/$folder"
done

printf '\n[gone](nowhere.md)\n' >>"$copy/docs/limits.md"
printf '\n[gone](docs/limits.md#no-such-heading)\n' >>"$copy/README.md"
printf '\nSee `server/nowhere/at_all.cpp`.\n' >>"$copy/docs/limits.md"
printf '\nAsk for `Coupling::Nowhere`.\n' >>"$copy/CONTRIBUTING.md"
printf '# Alone\n' >"$copy/docs/alone.md"
yes 'A line.' | head -n 200 >>"$copy/README.md"
{ printf '\n'; yes word | head -n 91 | tr '\n' ' '; printf '\n'; } >>"$copy/docs/limits.md"
head -c 150001 /dev/zero >"$copy/docs/pictures/large.jpg"
sed -i 's/^| `fibre_direction`/| `fiber_direction`/' "$copy/docs/scripts-and-scenarios.md"
sed -i '0,/^| `--organ/s//| `--orgn/' "$copy/docs/programs.md"
printf '\nUse `--no-such-option`.\n' >>"$copy/docs/limits.md"

# expect CHECK WORDS...: the check fails and says all of these.
expect() {
  local check=$1 said words
  shift
  if said=$(bash "$root/tests/docs/check_docs.sh" "$check" "$copy" "$bin"); then
    printf '%s: found no fault\n' "$check"
    failed=1
  fi
  for words; do
    grep -qF -- "$words" <<<"$said" && continue
    printf '%s: wanted "%s", got:\n%s\n' "$check" "$words" "$said"
    failed=1
  done
}

expect links 'link to nowhere.md: there is no such file' 'docs/limits.md has no such heading' \
  'names server/nowhere/at_all.cpp' 'names Coupling::Nowhere, which no source has' 'no page leads to docs/alone.md'
expect style 'allowed are 150' 'a paragraph of 91 words' 'large.jpg: has 150001 bytes'
expect keys 'neither has the key fibre_direction' 'has the key fiber_direction, which nothing reads'
expect options "'## trocar-server' does not have --organ" \
  "'## trocar-server' has --orgn, which trocar-server does not have" \
  'docs/limits.md: names --no-such-option'
exit $failed
