#!/usr/bin/env bash
# Checks the model of the ownership rules with spin. Usage: check_claims.sh FOLDER
#
# Each row of the table below is one search through all states of one configuration. It must end as the
# row says: without an error, or with the error that is named. The models are compiled in FOLDER, which
# is emptied before; after an unexpected error it holds the trail. Prints a row per search; the exit code
# is 1 if one ends otherwise, 77 without spin or a C compiler.
set -uo pipefail
export LC_ALL=C.UTF-8

model=$(cd "$(dirname "$0")" && pwd)/claims.pml
folder=${1:?folder for what is compiled}
for tool in spin "${CC:-cc}"; do
  command -v "$tool" >/dev/null && continue
  echo "SKIPPED: $tool is missing, so the ownership rules were not checked: deploy/setup --with-tests"
  exit 77
done
mkdir -p "$folder" && cd "$folder" || exit 2
rm -f ./*.trail ./*.log pan pan.* claims.pml
cp "$model" .

memory_mb=256 seconds=400 depth=600000
failed=0

# search NAME WANTED DEFINES: WANTED is "fine", or the words of the error; where they name an acceptance
# cycle, or DEFINES have LIVENESS, endless runs are looked at, too.
search() {
  local name=$1 wanted=$2 log=$1.log mode=(-DSAFETY -DNOREDUCE) run=() begin found verdict
  shift 2
  if [[ " $* " == *" -DLIVENESS "* && " $* " != *" -DBOUND="* ]]; then mode=(-DNOREDUCE) run=(-a); fi
  if [[ " $* " == *" -DBOUND="* ]]; then mode+=(-DNOCLAIM); fi
  rm -f pan pan.* claims.pml.trail
  begin=$(date +%s.%N)
  {
    spin -a "$@" claims.pml && "${CC:-cc}" -O2 -w -o pan pan.c -DMEMLIM=$memory_mb "${mode[@]}" &&
      timeout $seconds ./pan -m$depth -w18 "${run[@]}"
  } >"$log" 2>&1
  found=$(sed -n 's/^pan:[0-9]*: \(.*\) (at depth.*/\1/p' "$log" | head -n 1)
  if ! grep -q 'errors: [01]$' "$log" || grep -q 'depth too small' "$log"; then
    verdict="NOT FINISHED, see $folder/$log"
  elif [ "$wanted" = fine ]; then
    verdict=${found:+"WRONG: $found"}
  elif [ -z "$found" ]; then
    verdict="WRONG: no error was found, wanted: $wanted"
  elif [[ $found != *"$wanted"* ]]; then
    verdict="WRONG: $found, wanted: $wanted"
  else
    verdict="error found, as it must be"
  fi
  case ${verdict:=fine} in
    NOT* | WRONG*)
      failed=1
      [ -e claims.pml.trail ] && mv claims.pml.trail "$name.trail"
      ;;
  esac
  printf '%-22s %8s states %10s transitions %4s MB %6.1f s  %s\n' "$name" \
    "$(sed -n 's/^ *\([0-9]*\) states, stored.*/\1/p' "$log")" \
    "$(sed -n 's/^ *\([0-9]*\) transitions.*/\1/p' "$log")" \
    "$(sed -n 's/^[[:space:]]*\([0-9]*\)\.[0-9]*[[:space:]]*total actual.*/\1/p' "$log")" \
    "$(awk -v a="$begin" -v b="$(date +%s.%N)" 'BEGIN {print b - a}')" "$verdict"
}

short=(-DLEASE=0 -DABANDON=1 -DABANDON_RAMP=1)
any=(-DBLADES -DPUSHES -DSLIPS -DLEAVES -DMARKS)
one=(-DLIVENESS -DTOOLS=3 -DME_CORE=1)
disjoint='(held[t]>>n)&1' holds_nothing='phase[t]!=1)||(held[t]==0' released='silent[t]<='

# What the rules promise.
search any-history fine -DTOOLS=2 -DNODES=3 "${any[@]}"
search four-nodes fine -DTOOLS=2 -DNODES=4 -DLEAVES
search three-graspers fine -DTOOLS=3 -DNODES=3 "${short[@]}"
search three-leave fine -DTOOLS=3 -DNODES=2 -DLEAVES
search three-blades fine -DTOOLS=3 -DNODES=2 -DBLADES "${short[@]}"
search one-node-first fine "${one[@]}" -DNODES=3 -DME=0 "${short[@]}" -DLEAVES
search one-node-last fine "${one[@]}" -DNODES=3 -DME=2 "${short[@]}" -DLEAVES
search overtaken-twice fine "${one[@]}" -DNODES=2 -DME=2 -DLEAVES -DBOUND=2
# What they do not promise.
search overtaken-once 'overtaken<=1' "${one[@]}" -DNODES=2 -DME=2 -DLEAVES -DBOUND=1
search two-nodes-starve 'acceptance cycle' -DLIVENESS -DTOOLS=3 -DNODES=2 -DME=0 -DME_CORE=3 "${short[@]}"
search blades-pass-by 'acceptance cycle' "${one[@]}" -DNODES=1 -DME=0 -DBLADES "${short[@]}"
search hands-of-two 'phase[((2*1)+1)]==1' -DHANDS_OF_TWO -DTOOLS=4 -DNODES=2
# Each rule is needed, and its loss is found.
search no-exclusion "$disjoint" -DTOOLS=2 -DNODES=2 -DNO_EXCLUSION
search no-lease "$released" -DTOOLS=2 -DNODES=2 -DNO_LEASE
search no-return-check "$disjoint" -DTOOLS=2 -DNODES=2 -DNO_RETURN_CHECK -DLEAVES
search no-tie-rule 'acceptance cycle' "${one[@]}" -DNODES=1 -DME=2 -DNO_TIE_RULE "${short[@]}"
search partial-grants "$holds_nothing" -DTOOLS=2 -DNODES=2 -DPARTIAL_GRANTS
exit $failed
