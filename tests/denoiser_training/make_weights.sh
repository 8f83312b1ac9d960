#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Renders pictures and trains on them at once; see README.md. What is under way goes on by itself
# when this call ends before it; another call waits for the rest, or takes up what was killed.
#   PROGRAM        denoiser_pictures, as a command
#   STATE          folder for films, states and logs             (denoiser_state)
#   OUT            folder for weights, log and table             (STATE/result)
#   TOTAL_MINUTES  from the first call until all is done         (60)
#   MINUTES        that this call waits                          (TOTAL_MINUTES)
#   THREADS        that render                                   (all)
#   TARGET_PATHS   of each of the two films to compare with      (32)
#   GPUS           that train, as 0,1,2                          (0)
#   RENDER_DEVICE  Vulkan device that renders beside THREADS     (none)
#   RENDERERS      processes on it                               (12)
#   RENDER_MINUTES that are rendered, where one GPU does all     (until 20 s before the end)
#   BEGIN_FROM     weights to begin with                         (none)
#   JUDGE          folder with assets_root/ and bench/           (no judging)
#   JUDGED_SETS    numbers of the sets to judge by               (0 1 2 3 4 5 6 7 8)
#   OIDN           NAME=FILE.tza ...: to compare with            (none)
set -u
here=$(cd "$(dirname "$(readlink -f "$0")")" && pwd)
STATE=$(realpath -m "${STATE:-denoiser_state}")
OUT=$(realpath -m "${OUT:-$STATE/result}")
TOTAL_MINUTES=${TOTAL_MINUTES:-60}
MINUTES=${MINUTES:-$TOTAL_MINUTES}
THREADS=${THREADS:-$(nproc)}
PYTHON=${PYTHON:-python3}
mkdir -p "$STATE"/{films,judged,weights,sets} "$OUT"
cd "$STATE"
export STATE OUT TOTAL_MINUTES THREADS PYTHONUNBUFFERED=1 OMP_NUM_THREADS=2
export CUDA_VISIBLE_DEVICES=${GPUS:-0}
trainers=$(tr ',' '\n' <<<"$CUDA_VISIBLE_DEVICES" | wc -l)
[ -e since ] || date +%s >since
since=$(<since)
judging=$([ -n "${JUDGE:-}" ] && echo 60 || echo 5)
until=$("$PYTHON" -c "print(int($since + 60 * $TOTAL_MINUTES - $judging))")
render_until=$((until - 20))
wanted=$((since + 60 * ${RENDER_MINUTES:-TOTAL_MINUTES}))
[ "$wanted" -lt "$render_until" ] && render_until=$wanted

seconds() { date +%s; }

# Takes the sets to judge by that nobody has, one after the other.
render_judged() {
  for set in ${JUDGED_SETS:-0 1 2 3 4 5 6 7 8}; do
    mkdir "sets/judged_$set" 2>/dev/null || continue
    nice $PROGRAM judged --judge "$JUDGE" --first "$set" --sets 1 --width 240 --height 180 \
      --target-paths 384
  done
}

# One process a set: none can end more than its own. On a GPU a few: to open it takes a second.
render() {
  local worker=$1 number=0
  [ "$worker" -le 4 ] && [ -n "${JUDGE:-}" ] && render_judged
  while [ "$(seconds)" -lt "$render_until" ]; do
    number=$((number + 1))
    mkdir "sets/${worker}_$number" 2>/dev/null || continue
    nice $PROGRAM films --first $((worker * 10000 + number)) --sets 1 --views 7 \
      --target-paths "${TARGET_PATHS:-32}"
  done
}
render_on_gpu() {
  local worker=$1 number=1
  while [ "$(seconds)" -lt "$render_until" ]; do
    nice $PROGRAM films --device "$RENDER_DEVICE" --first $(((1000 + worker) * 10000 + number)) --sets 20 --views 7 \
      --target-paths "${TARGET_PATHS:-32}" --seconds $((render_until - $(seconds)))
    number=$((number + 20))
  done
}

# Ends what makes no step within two minutes, once there is what to train on; to get ready it has
# five, as kernels are compiled then, beside all that renders.
watch() {
  local pid=$1 now alive ready=0 most
  touch weights/alive
  while kill -0 "$pid" 2>/dev/null; do
    sleep 2
    now=$(seconds)
    alive=$(stat -c %Y weights/alive)
    if [ "$ready" = 0 ]; then
      [ "$(find films -name '*.films' | wc -l)" -ge 60 ] && ready=$now
      continue
    fi
    if [ "$alive" -gt "$ready" ]; then
      most=120
    else
      alive=$ready
      most=300
    fi
    if [ $((now - alive)) -gt "$most" ]; then
      echo "training stands still: ended"
      pkill -9 -P "$pid"  # the launcher's processes would outlive it
      kill -9 "$pid"
    fi
  done
}

train() {
  local way pid
  for way in "" "" "--no-graphs" "--no-graphs --batch 24" "--no-graphs --batch 24"; do
    [ "$(seconds)" -lt "$until" ] || break
    # shellcheck disable=SC2086
    "$PYTHON" -m torch.distributed.run --nproc_per_node "$trainers" "$here/train.py" films weights --since "$since" --until "$until" \
      ${BEGIN_FROM:+--begin-from "$BEGIN_FROM"} ${TRAIN_OPTIONS:-} $way &
    pid=$!
    watch $pid
    wait $pid && break
    echo "training failed $way"
  done
}

all() {
  for i in $(seq 1 "$THREADS"); do
    render "$i" 2>&1 | grep -v '^set ' &
  done
  if [ -n "${RENDER_DEVICE:-}" ]; then
    for i in $(seq 1 "${RENDERERS:-12}"); do render_on_gpu "$i" 2>&1 & done
  fi
  train
  if [ -n "${JUDGE:-}" ]; then
    mkdir -p sheets
    networks=(--network network=weights/denoiser.bin)
    judges=()
    for judge in ${OIDN:-}; do judges+=(--oidn "$judge"); done
    timeout 100 "$PYTHON" "$here/judge.py" judged "${networks[@]}" "${judges[@]}" --out sheets \
      >table.txt 2>&1
    tar czf sheets.tar.gz sheets
  fi
  touch done
}

if [ "${1:-}" = --all ]; then
  all
  exit
fi
begin() {
  [ -e pid ] && kill -0 "$(<pid)" 2>/dev/null && return
  echo "begun at $(date -u +%T)" >>log
  setsid nohup bash "$here/make_weights.sh" --all >>log 2>&1 </dev/null &
  echo $! >pid
}
end=$("$PYTHON" -c "print(int($(seconds) + 60 * $MINUTES))")
lines=0
hand_out() {
  for file in weights/denoiser.bin log table.txt sheets.tar.gz; do
    [ -e "$file" ] && cp -p "$file" "$OUT/.part" && mv "$OUT/.part" "$OUT/$(basename "$file")"
  done
  tail -n +$((lines + 1)) log
  lines=$(wc -l <log)
}
[ -e done ] || begin
while [ ! -e done ] && [ "$(seconds)" -lt "$end" ]; do
  begin
  sleep 5
  hand_out
done
hand_out
echo "$(find films -name '*.films' | wc -l) views, $(find judged -name '*.films' | wc -l) judged"
[ -e done ] && cat table.txt 2>/dev/null
exit 0
