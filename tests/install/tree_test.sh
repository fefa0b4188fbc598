#!/usr/bin/env bash
# Installs what is built into an empty folder, and looks whether all is there and finds its parts.
# Usage: tests/install/tree_test.sh ROOT BUILD
set -euo pipefail
root=$1 build=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
faults=0
fault() { printf '%s\n' "$*"; faults=$((faults + 1)); }

cmake --install "$build" --prefix "$work/usr" >"$work/log" 2>&1 || { tail -n 5 "$work/log"; exit 1; }
if grep -v "^-- \(\(Installing\|Up-to-date\): $work\|Install configuration\)" "$work/log"; then
  fault "these lie outside of the prefix, or are no files"
fi
programs=(server hall relay organ sim journal impair web)
if grep -q '^TROCAR_CLIENT:BOOL=ON' "$build/CMakeCache.txt"; then programs+=(client); fi
for program in "${programs[@]}"; do
  "$work/usr/bin/trocar-$program" --version >/dev/null || fault "trocar-$program does not start"
done
find "$work/usr/bin" "$work/usr/lib" -type f \( -perm -u+x -o -name '*.so' \) >"$work/log"
while read -r file; do
  ! readelf -SW "$file" | grep -q '[.]debug_' || fault "${file#"$work/"} has lines for debuggers"
done <"$work/log"
for file in lib/systemd/system/trocar@.service lib/systemd/system/trocar-hall.service 'lib/systemd/system/trocar-relay@.service' lib/systemd/system/trocar-web.service \
  share/applications/trocar-join.desktop share/mime/packages/trocar.xml share/icons/hicolor/scalable/apps/trocar.svg \
  share/trocar/scenes/incise.toml share/doc/trocar/LICENSE share/doc/trocar/docs/install.md \
  share/doc/trocar-server/examples/trocar-server.toml share/doc/trocar-server/examples/trocar-hall.toml \
  share/doc/trocar-server/examples/trocar-relay.toml \
  share/doc/trocar-server/examples/monitoring/alerts.yml share/doc/trocar-web/examples/trocar-web.toml; do
  [ -s "$work/usr/$file" ] || fault "$file is missing"
done
[ ! -e "$work/usr/etc" ] && [ ! -e "$work/etc" ] || fault "files of /etc are there, which only packages have"
if [ -e "$build/python" ]; then
  module=$(find "$work/usr/lib" -path '*/python3.*/dist-packages/trocar/_engine.*.so' -printf '%h/..\n')
  PYTHONPATH=$module /usr/bin/python3 "$work/usr/share/trocar/python/fit_material.py" >"$work/log" 2>&1 ||
    fault "the module for Python or its example does not start: $(cat "$work/log")"
fi

# Configurations of the packages are ones that the programs take.
cd "$work"
"$work/usr/bin/trocar-server" --config "$root/deploy/install/lesson.toml" --check-config >"$work/log" 2>&1 ||
  fault "$(cat "$work/log")"
"$work/usr/bin/trocar-server" --config "$work/usr/share/doc/trocar-server/examples/trocar-server.toml" --check-config \
  >"$work/log" 2>&1 || fault "$(cat "$work/log")"
"$work/usr/bin/trocar-relay" --config "$work/usr/share/doc/trocar-server/examples/trocar-relay.toml" --check-config \
  >"$work/log" 2>&1 || fault "$(cat "$work/log")"
for file in "$root/deploy/install/hall.toml" "$work/usr/share/doc/trocar-server/examples/trocar-hall.toml"; do
  XDG_STATE_HOME=$work "$work/usr/bin/trocar-hall" --config "$file" --check-config >"$work/log" 2>&1 || fault "$(cat "$work/log")"
done
# The hall of the package offers each lesson.
for file in "$root"/common/lesson/lessons/*.toml; do
  name=$(basename "$file" .toml)
  grep -qx "lesson = \"$name\"" "$root/deploy/install/hall.toml" || fault "deploy/install/hall.toml: does not offer $name"
done
if [ -e "$work/usr/share/trocar/web/index.html" ]; then
  "$work/usr/bin/trocar-web" --config "$root/deploy/install/web.toml" --check-config >"$work/log" 2>&1 ||
    fault "$(cat "$work/log")"
fi

# What is made from --help: a completion that offers an option, a command and a value.
complete_words() { # PROGRAM WORD...: what is offered for the last word
  bash -c '. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _${1//-/_}; printf "%s\n" "${COMPREPLY[@]}"' \
    - "$work/$1.bash" "$@"
}
for program in "${programs[@]}"; do
  "$root/deploy/lib/completion" "$work/usr/bin/trocar-$program" "$work/trocar-$program.bash" ||
    fault "trocar-$program: no completion can be made"
  complete_words "trocar-$program" --he | grep -qx -- --help || fault "trocar-$program --he is not completed"
done
complete_words trocar-server --log-level d | grep -qx debug || fault "trocar-server --log-level d is not completed"
complete_words trocar-hall st | grep -qx start || fault "trocar-hall st is not completed"
complete_words trocar-journal ver | grep -qx verify || fault "trocar-journal ver is not completed"
complete_words trocar-journal verify --js | grep -qx -- --json || fault "trocar-journal verify --js is not completed"

for script in "$root"/deploy/debian/*/{preinst,postinst,prerm,postrm}; do
  [ ! -e "$script" ] || sh -n "$script" || fault "$script: is no script of sh"
done
[ "$faults" -eq 0 ] && echo "all is there"
