# ctest's JUnit report as lines "passed|failed|skipped <tab> name[: reason]".
# A skipped GoogleTest prints the reason on the lines between "Skipped" and "[  SKIPPED ]"; a script
# prints "SKIPPED: reason".
function unescape(s) {
  gsub(/&lt;/, "<", s); gsub(/&gt;/, ">", s); gsub(/&quot;/, "\"", s); gsub(/&amp;/, "\\&", s)
  return s
}
/<testcase / {
  name = $0; sub(/.*<testcase name="/, "", name); sub(/".*/, "", name)
  status = $0; sub(/.* status="/, "", status); sub(/".*/, "", status)
  kind = status == "run" ? "passed" : "failed"
  why = status == "run" ? "" : "did not run"
  if (status == "disabled") { kind = "skipped"; why = "" }
  in_reason = 0; reason = status == "disabled" ? "disabled in the source" : ""
}
/<failure/ { kind = "failed"; why = $0; sub(/.*message="/, "", why); sub(/".*/, "", why) }
/<skipped/ { if ($0 ~ /SKIP_|Skipped/) { kind = "skipped"; why = "" } }
/\[  SKIPPED \]/ { in_reason = 0 }
in_reason && reason == "" && NF { reason = $0 }
/: Skipped$/ { in_reason = 1 }
/SKIPPED: / && reason == "" { reason = $0; sub(/.*SKIPPED: /, "", reason) }
/<\/testcase>/ {
  if (kind == "skipped") why = reason == "" ? "no reason given" : reason
  printf "%s\t%s%s\n", kind, unescape(name), why == "" ? "" : ": " unescape(why)
}
