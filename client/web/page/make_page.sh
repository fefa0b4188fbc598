#!/bin/sh
# make_page.sh SOURCE_ROOT WORK_FOLDER PAGE_FOLDER REPLICA_WASM: builds the page in the work
# folder. Where npm has no modules and cannot reach its registry nothing is built, and a line says so.
set -eu
root=$1
work=$2
page=$3
module=$4
source_folder=$root/client/web/page

code=0
"$root/deploy/lib/modules" "$source_folder" "$work" || code=$?
if [ "$code" -eq 77 ]; then
  echo "The page for browsers is not built: npm cannot reach its registry, see $work/npm.log"
  exit 0
fi
[ "$code" -eq 0 ] || exit "$code"
cd "$work"
cp "$source_folder/tsconfig.json" "$source_folder/build.mjs" .
rm -rf src
cp -r "$source_folder/src" src
node build.mjs "$root" "$page" "$module"
