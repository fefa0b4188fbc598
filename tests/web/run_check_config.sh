#!/usr/bin/env bash
# run_check_config.sh BUILD OUT: --check-config of trocar-web and trocar-relay refuses what a start would
# refuse, in one line that names file, line and key, and makes nothing.
set -euo pipefail
. "$(dirname "$0")/../support/programs_apart.sh"
bin=$(cd "$1/bin" && pwd)
go_apart "$2"
fail() {
  echo "check_config: $*"
  exit 1
}
mkdir page
echo '<html>' >page/index.html
: >file
mkdir -m 755 open
echo 'ada:secret' >creds
chmod 644 creds
check() { # PROGRAM LINE...
  local program=$1
  shift
  printf '%s\n' "$@" >c.toml
  code=0
  "$bin/$program" --config c.toml --check-config >said 2>&1 || code=$?
}
refuses() { # WORDS PROGRAM LINE...
  local words=$1
  shift
  check "$@"
  [ $code = 2 ] && grep -q -- "$words" said && [ "$(wc -l <said)" = 1 ] || fail "'$*': $code, $(cat said)"
}
page='page = "page"'
before=$(ls -R .)
check trocar-web "$page"
[ $code = 0 ] || fail "$(cat said)"
refuses 'c.toml:2: key state' trocar-web "$page" 'state = "file"'
refuses 'chmod 700' trocar-web "$page" 'state = "open"'
refuses 'c.toml:2: key ready-file' trocar-web "$page" 'ready-file = "nowhere/ready"'
refuses 'c.toml:2: key listen' trocar-web "$page" 'listen = "nowhere:7691"'
relay='code = "0000-0000-0000-0000"'
check trocar-relay "$relay"
[ $code = 0 ] || fail "$(cat said)"
refuses 'c.toml:2: key state' trocar-relay "$relay" 'state = "file"'
refuses 'c.toml:2: key ready-file' trocar-relay "$relay" 'ready-file = "nowhere/ready"'
refuses 'missing.crt' trocar-relay "$relay" 'certificate = "missing.crt"' 'key = "missing.key"'
rm -f c.toml said
[ "$(ls -R .)" = "$before" ] || fail "a check has made something: $(ls -R .)"
# A build without NATS says that instead.
check trocar-relay "$relay" 'nats = "nats://127.0.0.1:1"' 'publish = "monday"'
grep -q 'built without NATS' said && exit 0
refuses "'foo' is neither" trocar-relay "$relay" 'nats = "foo"' 'publish = "monday"'
refuses 'creds' trocar-relay "$relay" 'nats = "nats://127.0.0.1:1"' 'nats-creds = "creds"' 'publish = "monday"'
