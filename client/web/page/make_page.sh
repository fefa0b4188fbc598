#!/bin/sh
# make_page.sh SOURCE_ROOT WORK_FOLDER PAGE_FOLDER REPLICA_WASM: builds the page. Modules stay in the work
# folder, so that the registry is asked once. Without it nothing is built, and a line says so.
set -eu
root=$1
work=$2
page=$3
module=$4
source_folder=$root/client/web/page

mkdir -p "$work"
cd "$work"
cp "$source_folder/package.json" "$source_folder/package-lock.json" "$source_folder/.npmrc" \
  "$source_folder/tsconfig.json" "$source_folder/build.mjs" .
if ! cmp -s package-lock.json installed-lock.json; then
  if ! npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1; then
    if grep -qE 'ENOTFOUND|ECONN|ETIMEDOUT|EAI_AGAIN|ENETUNREACH|ENOTCACHED|network' npm.log; then
      echo "The page for browsers is not built: npm cannot reach its registry, see $work/npm.log"
      exit 0
    fi
    cat npm.log
    exit 1
  fi
  cp package-lock.json installed-lock.json
fi
rm -rf src
cp -r "$source_folder/src" src
node build.mjs "$root" "$page" "$module"
