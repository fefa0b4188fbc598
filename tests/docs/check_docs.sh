#!/usr/bin/env bash
# Checks the book. Usage: check_docs.sh links|style|options|keys ROOT [FOLDER_OF_PROGRAMS]
#
#   links    each link, picture and anchor of README, CONTRIBUTING and docs leads somewhere, each page is
#            in the README's table and in the site's list, each path and qualified name of the source
#            that is named exists
#   style    the README keeps 150 lines, paragraphs keep 90 words, pictures keep 150 kB
#   options  docs/programs.md has exactly the options that the programs' --help has, and no page names
#            an option that no program or script has
#   keys     docs/scripts-and-scenarios.md and docs/thread.md have exactly the keys that the sources
#            read
#
# Each fault is one line on stdout; the exit code is 1 if there is any. What --help says is asked once.
set -uo pipefail
export LC_ALL=C.UTF-8

check=${1:?check} root=$(cd "${2:?root of the repository}" && pwd) bin=${3:+$(cd "$3" && pwd)}
cd "$root" || exit 2
work=$(mktemp -d)
faults=$work/faults
: >"$faults"
trap 'rm -rf "$work"' EXIT
fault() { printf '%s\n' "$*" >>"$faults"; }

pages=(README.md CONTRIBUTING.md docs/*.md)
# Pages that a generator writes: their numbers and rows are its business.
is_generated() { head -n 5 "$1" | grep -qiE 'generated|(written|made) by'; }

# Text outside of code blocks, with line numbers kept.
prose() { awk '/^```/ {f = !f; print ""; next} f || /^(    |\t)[^-* ]/ {print ""; next} {print}' "$1"; }

# Anchors of a page, as GitHub and MkDocs make them from its headings.
declare -A anchors_of=()
anchors() {
  [ -n "${anchors_of[$1]:-}" ] || anchors_of[$1]=$'\n'$(made_anchors "$1")$'\n'
}
made_anchors() {
  prose "$1" | sed -n 's/^#\{1,6\} \(.*\)$/\1/p' | tr '[:upper:]' '[:lower:]' |
    sed 's/[^a-z0-9 _-]//g; s/^ *//; s/ *$//; s/ /-/g'
}

# All names of the form SCOPE::NAME, once: those that sources say so, and the classes that a header declares
# beside the namespace SCOPE.
said_names() {
  {
    grep -rhoE --include='*.h' --include='*.cpp' '[A-Za-z0-9_]+(::[A-Za-z0-9_]+)+' common server client |
      awk -F:: '{for (i = 1; i < NF; ++i) print $i "::" $(i + 1)}'
    find common server client -name '*.h' -print0 | xargs -0 awk '
      function done(s, n) { for (s in scopes) for (n in names) print s "::" n; delete scopes; delete names }
      FNR == 1 { done() }
      /^namespace trocar::[a-z_0-9]+ / { scope = $2; sub(/^trocar::/, "", scope); scopes[scope] }
      { line = $0
        while (match(line, /(class|struct) [A-Za-z0-9_]+/)) {
          word = substr(line, RSTART, RLENGTH); sub(/^[a-z]+ /, "", word); names[word]
          line = substr(line, RSTART + RLENGTH)
        } }
      END { done() }'
  } | sort -u >"$work/names"
}

check_links() {
  local page target file anchor
  said_names
  for page in "${pages[@]}"; do
    while read -r target; do
      case $target in http://* | https://* | mailto:*) continue ;; esac
      file=${target%%#*} anchor=
      [[ $target == *'#'* ]] && anchor=${target#*#}
      if [ -z "$file" ]; then
        file=$page
      elif [[ $page == */* ]]; then
        file=${page%/*}/$file
      fi
      if [ ! -e "$file" ]; then
        fault "$page: link to $target: there is no such file"
      elif [ -n "$anchor" ]; then
        anchors "$file"
        [[ ${anchors_of[$file]} == *$'\n'"$anchor"$'\n'* ]] ||
          fault "$page: link to $target: $file has no such heading"
      fi
    done < <(prose "$page" | grep -oE '\]\([^) ]+\)' | sed 's/^](//; s/)$//')
    # Paths of the source in code spans.
    while read -r target; do
      [ -e "$target" ] || fault "$page: names $target, which does not exist"
    done < <(grep -oE '`(server|client|common|proto|tests|deploy)/[A-Za-z0-9_./-]*[A-Za-z0-9_]`' "$page" |
      tr -d '`' | sort -u)
    # Names of the source in code spans, as scope::name.
    grep -oE '`[A-Za-z_]+(::[A-Za-z_]+)+`' "$page" | tr -d '`' | sort -u |
      awk -v page="$page" -F:: 'NR == FNR {is_said[$0]; next}
        !($(NF - 1) "::" $NF in is_said) {print page ": names " $0 ", which no source has"}' "$work/names" - >>"$faults"
  done
  for page in docs/*.md; do
    grep -qF "($page)" README.md || grep -qF "($(basename "$page"))" docs/*.md ||
      fault "README.md: no page leads to $page"
    grep -qE ": $(basename "$page")\$" deploy/mkdocs.yml ||
      fault "deploy/mkdocs.yml: $(basename "$page") is not in nav"
  done
}

check_style() {
  local page lines
  lines=$(wc -l <README.md)
  [ "$lines" -le 150 ] || fault "README.md: has $lines lines, allowed are 150"
  for page in "${pages[@]}"; do
    is_generated "$page" && continue
    prose "$page" | awk -v page="$page" '
      function done() { if (words > 90) printf "%s:%d: a paragraph of %d words, allowed are 90\n", page, first, words; words = 0 }
      /^$/ || /^[#|>!-]/ || /^[0-9]+\. / { done() }
      /^$/ || /^[#|]/ { next }
      { if (!words) first = NR; words += NF }
      END { done() }' >>"$faults"
  done
  for page in docs/pictures/*; do
    lines=$(wc -c <"$page")
    [ "$lines" -le 150000 ] || fault "$page: has $lines bytes, allowed are 150000"
  done
}

help_of() { # PROGRAM [COMMAND]
  local text=$work/${1##*/}${2:+-$2}.help
  [ -e "$text" ] || "$@" --help >"$text" 2>/dev/null || { rm -f "$text"; return 1; }
  cat "$text"
}
# The options that a --help text on stdin names, one per line: those that begin a line.
options_of_help() { grep -oE '^ {2,}(-[a-z], ?)?--[a-z][a-z0-9-]*' | grep -oE -- '--[a-z][a-z0-9-]*' | sort -u; }
# The options in the first cells of the tables below a heading of docs/programs.md.
options_of_section() {
  awk -v heading="$1" '/^#/ {in_it = $0 == heading} in_it && /^\| `-/ {split($0, cell, "|"); print cell[2]}' \
    docs/programs.md | grep -oE -- '--[a-z][a-z0-9-]*' | sort -u
}

check_section() { # HEADING COMMAND...
  local heading=$1 line
  options_of_section "$heading" >"$work/written"
  shift
  help_of "$@" | sed '/^Examples:/,$d' >"$work/help" || fault "$*: has no --help"
  options_of_help <"$work/help" >"$work/offered"
  while read -r line; do
    fault "docs/programs.md: '$heading' does not have $line, which $(basename "$1")${2:+ $2} has"
  done < <(comm -13 "$work/written" "$work/offered")
  while read -r line; do
    fault "docs/programs.md: '$heading' has $line, which $(basename "$1")${2:+ $2} does not have"
  done < <(comm -23 "$work/written" "$work/offered")
}

check_options() {
  local program sub page option known
  known=$(mktemp)
  for program in trocar-server trocar-hall trocar-client trocar-organ trocar-sim trocar-journal trocar-impair trocar-web trocar-relay trocar-doctor $(cd "$bin" && ls trocar-igtl trocar-crtk 2>/dev/null); do
    [ -x "$bin/$program" ] || { fault "$bin/$program: is not built"; rm -f "$known"; return; }
    check_section "## $program" "$bin/$program"
    help_of "$bin/$program" | options_of_help >>"$known"
    for sub in $(help_of "$bin/$program" | awk '/^Commands:/ {f = 1; next} /^[^ ]/ {f = 0} f && /^  [a-z]/ {print $1}'); do
      check_section "### $program $sub" "$bin/$program" "$sub"
      help_of "$bin/$program" "$sub" | options_of_help >>"$known"
    done
  done
  for program in deploy/*; do
    [ -f "$program" ] && [ -x "$program" ] || continue
    help_of "./$program" | grep -oE -- '--[a-z][a-z0-9-]*' >>"$known"
  done
  grep -hoE '"--[a-z][a-z0-9-]*"' server/python/trocar/*.py deploy/python/*.py | tr -d '"' >>"$known"
  # Of cmake, systemctl, podman, ros2 and bench_crowd.
  printf '%s\n' --relays --watchers --preset --install --prefix --component --strip --now --rm --init --once >>"$known"
  for page in "${pages[@]}"; do
    while read -r option; do
      fault "$page: names $option, which no program or script has"
    done < <(grep -oE '(^|[ `(])--[a-z][a-z0-9-]+' "$page" | grep -oE -- '--[a-z][a-z0-9-]+' | sort -u |
      comm -23 - <(sort -u "$known"))
  done
  rm -f "$known"
}

readers=(server/lab/scenario/*.cpp server/tissue/thread/rules_toml.cpp common/tool/script*.cpp)
# Keys in the first or, below '| table | key', second cells of the tables.
documented_keys() {
  awk -F'|' '/^\| table \| key/ {c = 3; next} /^\| key in|^\| key \|/ {c = 2; next} /^$/ {c = 0}
    c && /^\|/ {print $c}' docs/scripts-and-scenarios.md docs/thread.md | grep -oE '`[a-z0-9_]+`' | tr -d '`' | sort -u
}
read_keys() {
  {
    grep -hoE '\b[a-z_]+(<[^>]*>)?\("[a-z0-9_]+"' "${readers[@]}" |
      grep -vE '^(fail|fail_missing|table_entry|fputs|contains|find|place_of|has|with|tables?|limited_tables)\('
    grep -hoE 'NumberKey\{"[a-z0-9_]+"' server/organs/material/material_keys.h
  } |
    grep -oE '"[a-z0-9_]+"' | tr -d '"' | sort -u
}

check_keys() {
  local key
  while read -r key; do
    grep -qF "\"$key\"" "${readers[@]}" server/organs/material/*.h ||
      fault "docs/scripts-and-scenarios.md or docs/thread.md: has the key $key, which nothing reads"
  done < <(documented_keys)
  while read -r key; do
    fault "docs/scripts-and-scenarios.md, docs/thread.md: neither has the key $key, which is read"
  done < <(comm -13 <(documented_keys) <(read_keys))
  [ "$(documented_keys | wc -l)" -ge 60 ] || fault "docs/scripts-and-scenarios.md: fewer than 60 keys were found"
}

case $check in
  links | style | options | keys) "check_$check" ;;
  *) printf '%s: no such check\n' "$check" >&2; exit 2 ;;
esac
cat "$faults"
[ ! -s "$faults" ]
