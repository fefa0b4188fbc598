# Shared by the scripts in deploy/. Sourced, never run. Each script sets `program` before.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

say() { printf '%s\n' "$*"; }
step() { printf '\n== %s\n' "$*"; }
# fail CODE MESSAGE: exit codes are those of the programs: 1 mismatch, 2 usage, 3 bad file,
# 5 something is missing.
fail() {
  printf '%s: %s\n' "$program" "$2" >&2
  exit "$1"
}

# Objects may be shared between checkouts of the same sources.
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$root} CCACHE_NOHASHDIR=1

# need_value OPTION "$@"-rest: fails unless the option is followed by a value.
need_value() {
  [ $# -ge 2 ] && [ -n "$2" ] || fail 2 "$1: needs a value, see $program --help"
}

# commit: of the sources, with a + if they are changed.
commit() {
  local id
  id=$(git -C "$root" rev-parse --short=12 HEAD 2>/dev/null) || { printf unknown; return; }
  git -C "$root" diff --quiet HEAD 2>/dev/null || id+=+
  printf '%s' "$id"
}

# absolute PATH: relative to where the person is, not to the repository.
absolute() {
  case $1 in
    /*) printf '%s' "$1" ;;
    *) printf '%s/%s' "$PWD" "$1" ;;
  esac
}

# All programs, as deploy/build and deploy/package build them.
all_programs=(trocar-server trocar-hall trocar-relay trocar-client trocar-organ trocar-organ-edit trocar-sim trocar-journal
  trocar-impair trocar-web trocar-doctor trocar-igtl trocar-crtk)

# build PRESET [TARGET...]: configures if needed and builds. The lines that say how far it is begin with
# $building. Tests are there if the script sets with_tests=true, after deploy/setup --with-tests; the page
# for browsers if its tools are there, which a script looks for again with with_web=true.
build() {
  local preset=$1 tests=OFF
  shift
  if ${with_tests:-false}; then tests=ON; fi
  if [ ! -e "$root/build/$preset/build.ninja" ] ||
    { ${with_web:-false} && [ "$preset" = release ] && ! grep -q web_page "$root/build/$preset/build.ninja"; } ||
    { [ $tests = ON ] && ! grep -q '^TROCAR_TESTS:BOOL=ON' "$root/build/$preset/CMakeCache.txt"; }; then
    (cd "$root" && cmake --preset "$preset" -DTROCAR_TESTS=$tests >"$root/build-$preset.log" 2>&1) || {
      cat "$root/build-$preset.log" >&2
      rm -f "$root/build-$preset.log"
      return 1
    }
    rm -f "$root/build-$preset.log"
  fi
  python3 "$root/deploy/lib/build.py" --what "${building:-Building}" "$root/build/$preset" "$@"
}
