#!/usr/bin/env bash
# What a farm of one worker costs against `flyby render` on the same processors, in pairs of alternating order:
# seconds of both, their ratio, and the coordinator's processor time as a share of the worker's.
#
#   benches/share.sh target/release/flyby [PAIRS] [RAYS] [RESOLUTION] [FRAMES]
set -euo pipefail

flyby=$(realpath "$1")
pairs=${2:-15} rays=${3:-3} resolution=${4:-200x150} frames=${5:-0..24}
scene=$(realpath "$(dirname "$0")/../scenes/flyby.toml")
settings=(--resolution "$resolution" --rays "$rays" --frames "$frames")
threads=$(nproc)
place=$(mktemp -d)
farm=()
trap 'kill "${farm[@]}" 2>/dev/null || true; wait; rm -rf "$place"' EXIT
cd "$place"

# Processor time of a process, its threads' together, in ticks of a hundredth of a second.
ticks() { sed 's/.*) //' "/proc/$1/stat" | awk '{print $12 + $13}'; }
now() { date +%s.%N; }
seconds_since() { echo "$(now) - $1" | bc; }

render() {
  local start
  start=$(now)
  "$flyby" render "$scene" "${settings[@]}" --threads "$threads" --existing replace -o frames >/dev/null 2>&1
  rendered=$(seconds_since "$start")
}

farm() {
  local start before_coordinator before_worker
  "$flyby" coordinator --state state --listen 127.0.0.1:0 >/dev/null 2>&1 &
  farm=($!)
  until [ -f state/coordinator.json ]; do sleep 0.05; done
  "$flyby" worker --state state --threads "$threads" >/dev/null 2>&1 &
  farm+=($!)
  until [ "$("$flyby" worker list --state state --output json | grep -c '"connected"' || true)" -gt 0 ]; do sleep 0.05; done
  before_coordinator=$(ticks "${farm[0]}") before_worker=$(ticks "${farm[1]}")
  start=$(now)
  "$flyby" submit "$scene" "${settings[@]}" --state state --watch >/dev/null 2>&1
  farmed=$(seconds_since "$start")
  coordinator=$(($(ticks "${farm[0]}") - before_coordinator))
  worker=$(($(ticks "${farm[1]}") - before_worker))
  kill "${farm[@]}"
  wait "${farm[@]}" || true
  farm=()
  rm -rf state
}

for pair in $(seq "$pairs"); do
  if ((pair % 2)); then render; farm; else farm; render; fi
  echo "$pair $rendered $farmed $coordinator $worker" |
    awk '{printf "pair %d: render %.2f s, farm %.2f s, ratio %.3f; coordinator %.2f s of CPU, worker %.2f s, share %.2f %%\n",
          $1, $2, $3, $3 / $2, $4 / 100, $5 / 100, 100 * $4 / $5}' | tee -a pairs
done
of() { grep -o "$1 [0-9.]*" pairs | cut -d' ' -f2 | sort -n; }
for what in ratio share; do
  of "$what" | awk -v what="$what" '{value[NR] = $1}
    END {print what ": median " value[int((NR + 1) / 2)] ", from " value[1] " to " value[NR]}'
done
