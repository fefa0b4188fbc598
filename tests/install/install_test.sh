#!/usr/bin/env bash
# Installs the packages into a bare Debian 12 as a new user would, uses and removes them.
# Usage: tests/install/install_test.sh FOLDER_OF_PACKAGES [BASE.tar]
#
# BASE.tar is a bare Debian 12, made by mmdebstrap if it is not there; without it one is made each time.
# Needs root for a root of its own, a network for the packages' dependencies, and minutes. Each step is one
# line; the exit code is 1 if one fails, 5 if something is missing.
set -uo pipefail
packages=$(cd "${1:?folder of packages}" && pwd) base=${2:-}
fail() { printf 'install_test: %s\n' "$2" >&2; exit "$1"; }
[ "$(id -u)" = 0 ] || fail 5 "needs root: it makes a root of its own"
command -v mmdebstrap >/dev/null || fail 5 "mmdebstrap is missing: deploy/setup --with-packages installs it"
work=$(mktemp -d)
root=$work/root
chmod 755 "$work"
# A bare one has what Debian calls essential, and apt.
if [ ! -e "${base:=$work/base.tar}" ]; then
  echo "making a bare Debian 12..."
  mmdebstrap --quiet --variant=minbase bookworm "$base" >"$work/log" 2>&1 ||
    { tail -n 3 "$work/log"; fail 5 "a bare Debian 12 cannot be made"; }
fi
servers=()
clean_up() {
  local pid
  for pid in "${servers[@]}"; do kill "$pid" 2>/dev/null && wait "$pid" 2>/dev/null; done
  umount "$root/proc/cpuinfo" 2>/dev/null
  umount "$root/proc" 2>/dev/null
  mountpoint -q "$root/proc" || rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM
mkdir "$root"
tar xpf "$base" -C "$root" || fail 5 "$base: cannot be unpacked"
mount -t proc proc "$root/proc" || fail 5 "this machine lets nobody mount /proc: use another"
cp /etc/resolv.conf "$root/etc/resolv.conf"
mkdir "$root/packages"
cp "$packages"/*.deb "$root/packages"

inside() { # COMMAND...: as root
  chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
    DEBIAN_FRONTEND=noninteractive "$@"
}
as() { # USER COMMAND: as somebody else, in the own home
  inside runuser -u "$1" -- env HOME="/home/$1" bash -c "cd; $2"
}
count=0 failures=0
check() { # NAME COMMAND...
  local name=$1
  shift
  count=$((count + 1))
  printf '%-58s' "$name"
  if "$@" >"$work/log" 2>&1; then
    echo passed
  else
    echo FAILED
    tail -n 20 "$work/log"
    failures=$((failures + 1))
  fi
}
# wait_for COMMAND...: up to a minute.
wait_for() {
  local i
  for ((i = 0; i < 600; ++i)); do
    if "$@" >/dev/null 2>&1; then return 0; fi
    sleep 0.1
  done
  echo "gave up: $*"
  return 1
}
# What the packages own or make, as far as its name says so; the person's own files are not theirs.
traces() {
  find "$root" -xdev \( -path "$root/proc" -o -path "$root/packages" -o -path "$root/home" \) -prune -o \
    -iname '*trocar*' -print
}

install_all() { inside sh -c 'apt-get install -y --no-install-recommends /packages/*.deb'; }
check "the lists of packages" inside apt-get update

# ---- Another processor ----
refuses_processor() {
  sed 's/avx2/none/g' /proc/cpuinfo >"$work/cpuinfo"
  mount --bind "$work/cpuinfo" "$root/proc/cpuinfo" || return 1
  inside sh -c 'dpkg -i /packages/trocar-server_*.deb' >"$work/refusal" 2>&1
  local code=$?
  umount "$root/proc/cpuinfo"
  cat "$work/refusal"
  [ $code -ne 0 ] && grep -q 'this processor has no avx2' "$work/refusal" && [ -z "$(traces | grep bin/)" ]
}
check "a processor without AVX2 is refused" refuses_processor

# ---- A new user ----
check "the packages and what they need" install_all
[ $failures -eq 0 ] || fail 1 "the packages cannot be installed"
check "each program starts" inside sh -c \
  'for p in server hall client organ sim journal impair; do trocar-$p --version || exit 1; done'
check "completions are sound" inside bash -c \
  'for f in /usr/share/bash-completion/completions/trocar-*; do . $f; complete -p ${f##*/} || exit 1; done'
check "each program has a page for man" inside sh -c \
  'for p in /usr/bin/trocar-*; do dpkg -L trocar-server trocar-client trocar-crtk trocar-tools trocar-web | grep -q "man1/${p##*/}.1.gz" || exit 1; done'
# Programs are stripped; what was taken away lies where a debugger looks, under the program's id.
lines_for_debuggers() {
  local file id faults=0
  for file in "$root"/usr/bin/trocar-* "$root"/usr/lib/python3/dist-packages/trocar/_engine.*.so; do
    [ -e "$file" ] || continue
    id=$(readelf -n "$file" | sed -n 's/.*Build ID: //p')
    if readelf -SW "$file" | grep -q '[.]debug_line' ||
      ! readelf -SW "$root/usr/lib/debug/.build-id/${id:0:2}/${id:2}.debug" 2>/dev/null | grep -q '[.]debug_line'; then
      echo "$file: its lines are in it, or not in $id"
      faults=1
    fi
  done
  return $faults
}
check "lines for debuggers have packages of their own" lines_for_debuggers
check "nobody else may read the state" inside sh -c 'getent passwd trocar | grep -q nologin'
inside useradd -m ada

lesson() {
  as ada 'trocar-server --lesson find-the-lump --seconds 8 --listen 127.0.0.1:0 --ready-file port --journal lesson.mcap' &
  local server=$! code=0
  servers+=("$server")
  wait_for test -s "$root/home/ada/port" || return 1
  as ada 'trocar-client --server 127.0.0.1:$(cat port) --no-render --name Ada --answer-at 4 --script /usr/share/trocar/scenes/probe.toml' ||
    code=$?
  wait "$server" || code=$?
  return $code
}
check "a lesson with a scripted hand, recorded" lesson
check "trocar-journal verify" as ada 'trocar-journal verify lesson.mcap'
check "trocar-journal assess" as ada 'trocar-journal assess lesson.mcap --json'
check "a picture without a display" as ada \
  'trocar-client --replay lesson.mcap --headless --size 640x360 --seconds 3 --screenshot picture.png && test -s picture.png'
check "a scenario" as ada 'trocar-sim /usr/share/trocar/scenes/pull.toml --out pull'
check "an organ" as ada 'trocar-organ make plate && trocar-organ inspect plate.organ'
# The first lines of docs/python.md, and an example that needs the scenes of the tools.
press() {
  cat >"$root/home/ada/press.py" <<'PYTHON'
import trocar
organ = trocar.Organ("liver")
session = trocar.Session(organ)
top = organ.nodes[organ.nodes[:, 2].argmax()]
session.put(0, top + [0, 0, 0.01], "push", shaft=(0, 0, 1))
session.step(100)
session.put(0, top - [0, 0, 0.004], "push", shaft=(0, 0, 1))
session.step(200)
assert session.force()[2] > 0
print(session.force(), "N", session.state_hash())
PYTHON
  as ada '/usr/bin/python3 press.py && /usr/bin/python3 /usr/share/trocar/python/fit_material.py'
}
if [ -e "$root"/usr/lib/python3/dist-packages/trocar/__init__.pyi ]; then check "a press in Python" press; fi

page() {
  local port answer
  as ada 'echo $$ >web-pid; exec trocar-web --insecure-loopback --listen 127.0.0.1:0 --recordings . --ready-file web-port' &
  wait_for test -s "$root/home/ada/web-port" || return 1
  port=$(cat "$root/home/ada/web-port")
  exec 3<>"/dev/tcp/127.0.0.1/$port"
  printf 'GET / HTTP/1.1\r\nHost: 127.0.0.1:%s\r\nConnection: close\r\n\r\n' "$port" >&3
  answer=$(tr -d '\0' <&3)
  exec 3>&-
  kill "$(cat "$root/home/ada/web-pid")"
  grep -q '200 OK' <<<"$answer" && grep -q '<title>' <<<"$answer"
}
if inside test -e /usr/bin/trocar-web; then check "the page is served" page; fi

# ---- A service ----
check "units are sound" inside sh -c \
  'cp /lib/systemd/system/trocar*.service /packages && cd /packages && mv trocar@.service trocar@lesson.service &&
    systemd-analyze verify --man=no ./trocar*.service'
check "the configurations are sound" inside sh -c \
  'trocar-server --config /etc/trocar/lesson.toml --check-config && trocar-hall --config /etc/trocar/hall.toml --check-config && { ! [ -e /usr/bin/trocar-web ] || trocar-web --config /etc/trocar/web.toml --check-config; }'
# What the unit does, as far as it goes without systemd: folders, user, command.
session() { # SECONDS
  inside install -d -o trocar -g trocar -m 0750 /var/lib/trocar /var/lib/trocar/recordings
  inside install -d -o trocar -g trocar -m 0700 /run/trocar-lesson
  rm -f "$root/var/lib/trocar/port"
  inside runuser -u trocar -- sh -c "umask 027; cd /var/lib/trocar/recordings; exec env XDG_RUNTIME_DIR=/run/trocar-lesson \
    trocar-server --config /etc/trocar/lesson.toml --state /var/lib/trocar/state --listen 127.0.0.1:7699 \
    --ready-file /var/lib/trocar/port --seconds $1" >"$work/session" 2>&1 &
  servers+=($!)
  wait_for test -s "$root/var/lib/trocar/port" || { cat "$work/session"; return 1; }
}
join() { # CODE
  as ada "trocar-client --server 127.0.0.1:7699 --join $1 --role observer --name Ada --no-render --seconds 1"
}
first_session() {
  session 6 || return 1
  code=$(awk '$1 == "observer" {print $2; exit}' "$work/session")
  [ -n "$code" ] || { cat "$work/session"; return 1; }
  local result=0
  join "$code" || result=1
  wait "${servers[-1]}" || result=1
  return $result
}
code=
check "a session of the user trocar, joined with its code" first_session
recordings() { find "$root/var/lib/trocar/recordings" -name '*.mcap' | wc -l; }
check "others cannot read its recordings" as ada '! ls /var/lib/trocar/recordings'

# ---- Removal and return ----
all=$(cd "$packages" && printf '%s\n' *.deb | sed 's/_.*//' | tr '\n' ' ')
remove_all() { inside sh -c "apt-get remove -y $all"; }
check "removal" remove_all
check "no program is left" inside sh -c \
  '[ -z "$(ls -d /usr/bin/trocar-* /usr/share/trocar /usr/lib/systemd/system/trocar* /usr/lib/python3/dist-packages/trocar)" ]'
check "configuration, codes and recordings are" test -e "$root/etc/trocar/lesson.toml" -a \
  -e "$root/var/lib/trocar/state/codes-7699.json" -a "$(recordings)" = 1
check "the same packages again" install_all
second_session() {
  session 6 || return 1
  local result=0
  join "$code" || result=1
  wait "${servers[-1]}" || result=1
  return $result
}
check "the old code is good" second_session
check "the first recording is there, and a second one" test "$(recordings)" = 2
check "an upgrade keeps what somebody changed in /etc" inside sh -c \
  'echo "# mine" >>/etc/trocar/lesson.toml; dpkg -i /packages/trocar-server_*.deb && tail -n 1 /etc/trocar/lesson.toml | grep -q mine'

check "purge" inside sh -c "apt-get purge -y $all"
nothing_left() {
  # systemd removes the folder in /run at the end of a session.
  rm -rf "$root/run/trocar-lesson"
  traces
  [ -z "$(traces)" ]
}
check "nothing is left" nothing_left

# ---- Under systemd ----
# A script in the root is a unit that runs at its start and ends it; each line of its result is a check.
if ! command -v systemd-nspawn >/dev/null; then
  echo "skipped: services, because systemd-nspawn is missing (systemd-container)"
else
  cp "$(dirname "$0")/services.sh" "$root/packages"
  rm -f "$root/packages"/*.service
  cat >"$root/etc/systemd/system/check.service" <<'UNIT'
[Service]
Type=idle
ExecStart=/packages/services.sh
[Install]
WantedBy=multi-user.target
UNIT
  inside systemctl --quiet enable check.service
  check "the packages once more" install_all
  umount "$root/proc"
  timeout 300 systemd-nspawn --quiet --register=no --keep-unit --private-network --directory "$root" --boot \
    >"$work/boot" 2>&1
  if [ -s "$root/packages/result" ]; then
    while read -r outcome name; do check "$name" test "$outcome" = passed; done <"$root/packages/result"
    if grep -q '^failed' "$root/packages/result"; then cat "$root/packages/services.log"; fi
    rm "$root/etc/systemd/system/check.service" "$root"/etc/systemd/system/multi-user.target.wants/check.service
    check "nothing is left of services" nothing_left
  else
    echo "skipped: services, because systemd does not start in a container here"
  fi
fi
echo "$((count - failures)) passed, $failures failed"
[ $failures -eq 0 ]
