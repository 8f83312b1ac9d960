#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A job in shards on Grid Engine; each task of the array makes one shard on a file system that all hosts
# share:
#   qsub -t 1-16 gridengine_job.sh configs/dining_room.yaml /scratch/dataset 16
# The last argument is the number of shards, so that one of them can be made again: -t 7.
# `auto` instead of it lets each task take visits until none is left, so that slow nodes hold up nothing.
# `diorama status OUTPUT` says what is missing. Every start goes on where the last one stopped. A task is put
# back into the queue (exit code 99) shortly before its time is over (a fourth argument: after so many seconds),
# when its host fails, and while the shard is in use elsewhere. Where the dataset cannot be written, it waits in
# the error state for `qmod -cj` (100).
#$ -cwd
#$ -j y
#$ -r y
#$ -notify
#$ -pe smp 8
#$ -l h_rt=04:00:00
#$ -S /bin/bash
set -u
usage='usage: qsub -t 1-SHARDS gridengine_job.sh JOB OUTPUT SHARDS [SECONDS]'
job=${1:?$usage}
output=${2:?$usage}
shards=${3:?$usage}
seconds=${4:-14100}
if [[ $SGE_TASK_ID == undefined ]]; then echo "$usage" >&2; exit 2; fi

shard=$SGE_TASK_ID/$shards
if [[ $shards == auto ]]; then shard=auto; fi

# Grid Engine announces an end to every process of the task with USR1 (suspension) or USR2 (qdel); diorama's
# word for it is TERM. Its own time limits (s_rt, h_rt) end a task that was put back once without another try.
(trap '' USR1 USR2 && exec timeout --foreground --preserve-status "$seconds" \
  diorama run "$job" --output "$output" --resume --threads "$NSLOTS" --shard "$shard") &
trap 'kill -TERM $! 2>/dev/null' USR1 USR2 TERM
# A signal ends `wait` before the program has ended.
while wait $!; kill -0 $! 2>/dev/null; do :; done
wait $!
code=$?

# Codes: framework/docs/exit_codes.md.
case $code in
  130 | 75) exit 99 ;;
  6) exit 100 ;;
  *) exit "$code" ;;
esac
