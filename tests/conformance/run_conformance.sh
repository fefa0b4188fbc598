#!/bin/sh
# run_conformance.sh WORK_FOLDER WRITER: writes journals with WRITER and reads them with @mcap/core.
# Exit code 77: skipped, with the reason.
set -eu
source_folder=$(cd "$(dirname "$0")" && pwd)
work_folder=$1
writer=$2

skip() {
  echo "SKIPPED: $1"
  echo "To run it: install Node.js 18 or newer with npm, and let npm reach a registry once"
  echo "(it keeps the modules in $work_folder)."
  exit 77
}

command -v node >/dev/null || skip "node is not installed"
command -v npm >/dev/null || skip "npm is not installed"
node -e 'process.exit(process.versions.node.split(".")[0] >= 18 ? 0 : 1)' || skip "node is older than 18"

code=0
"$source_folder/../../deploy/lib/modules" "$source_folder" "$work_folder" || code=$?
[ "$code" -ne 77 ] || skip "npm cannot reach its registry"
[ "$code" -eq 0 ] || exit "$code"
cd "$work_folder"

rm -rf journals
mkdir journals
"$writer" journals
for name in finished killed repaired one_each empty; do
  node "$source_folder/check_journal.mjs" "journals/$name.mcap" --modules .
done
node -e '
  const report = JSON.parse(require("fs").readFileSync(0));
  process.exit(report.finished && report.messages > 0 ? 0 : 1);' <<JSON
$(node "$source_folder/check_journal.mjs" journals/repaired.mcap --modules . --json)
JSON

# The check itself must be able to fail: one flipped bit in a chunk, one in the summary.
size=$(wc -c <journals/finished.mcap)
for at in 30000 $((size - 200)); do
  node -e '
    const fs = require("fs"), bytes = fs.readFileSync("journals/finished.mcap");
    bytes[Number(process.argv[1])] ^= 1;
    fs.writeFileSync("journals/damaged.mcap", bytes);' "$at"
  if node "$source_folder/check_journal.mjs" journals/damaged.mcap --modules . 2>damaged.log; then
    echo "a bit flipped at byte $at was not noticed"
    exit 1
  fi
  echo "flipped bit noticed: $(cat damaged.log)"
done
