# Packages of Debian, for deploy/setup. Sourced after common.sh.

# apt_as_root ARGUMENT...: apt-get, as root. One program at a time may install packages or load their
# lists: while another does, this says for whom it waits, and gives up after $wait_min minutes.
apt_as_root() {
  local errors holder start=$SECONDS said=-60
  local held='^E: Could not get lock .* held by process \([0-9]*\) (\(.*\)).*'
  until { errors=$("${as_root[@]}" env LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive apt-get "$@" 2>&1 >&3); } 3>&1; do
    if ! grep -q '^E: Could not get lock' <<<"$errors"; then
      say "$errors" >&2
      return 1
    fi
    holder=$(sed -n "s/$held/\\2 (process \\1)/p" <<<"$errors")
    holder=${holder:-another program}
    if ((SECONDS - start >= wait_min * 60)); then
      fail 5 "waited $wait_min min for $holder, which installs packages: let it end, then run this again"
    fi
    if ((SECONDS - said >= 60)); then
      said=$SECONDS
      say "Waiting for $holder, which installs packages: $(((SECONDS - start) / 60)) of at most $wait_min min"
    fi
    sleep 2
  done
  [ -z "$errors" ] || say "$errors" >&2
}

# Debian has Protocol Buffers for this machine only. The module for browsers compiles their sources, of
# the version that is installed; they come from where its packages come from, and nothing of the
# system's lists changes.
fetch_protobuf_sources() {
  local version upstream folder work
  version=$(dpkg-query -W -f='${source:Version}' libprotobuf-dev)
  upstream=${version%-*}
  folder=$root/build/sources/protobuf-$upstream
  [ ! -e "$folder/cmake/libprotobuf-lite.cmake" ] || return 0
  say "Loading the sources of Protocol Buffers $version..."
  work=$(mktemp -d)
  mkdir -p "$work/parts" "$work/lists/partial" "$work/cache/archives/partial" "$root/build/sources"
  local list
  for list in /etc/apt/sources.list.d/*.sources; do
    [ ! -e "$list" ] || sed 's/^Types:.*/Types: deb-src/' "$list" >"$work/parts/${list##*/}"
  done
  for list in /etc/apt/sources.list /etc/apt/sources.list.d/*.list; do
    [ ! -e "$list" ] || sed -n 's/^deb /deb-src /p' "$list" >"$work/parts/${list##*/}"
  done
  [ ! -e "$work/parts/sources.list" ] || mv "$work/parts/sources.list" "$work/parts/main.list"
  local apt=(apt-get -qq -o Dir::Etc::SourceList=/dev/null -o "Dir::Etc::SourceParts=$work/parts"
    -o "Dir::State::Lists=$work/lists" -o "Dir::Cache=$work/cache" -o APT::Sandbox::User=root)
  # Others than Debian may have no sources: only whether these came counts.
  "${apt[@]}" update >"$work/log" 2>&1 || true
  (cd "$work" && "${apt[@]}" source --download-only "protobuf=$version") >>"$work/log" 2>&1 || true
  if ! tar xzf "$work/protobuf_$upstream.orig.tar.gz" -C "$root/build/sources" 2>>"$work/log"; then
    tail -n 3 "$work/log" >&2
    rm -rf "$work"
    fail 5 "the sources of Protocol Buffers $version cannot be had: the page for browsers is not built"
  fi
  rm -rf "$work"
}
