#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A job in shards on Grid Engine; each task of the array makes one shard on a file system that all hosts
# share:
#   qsub -t 1-16 gridengine_job.sh configs/dining_room.yaml /scratch/dataset 16
# The last argument is the number of shards, so that one of them can be made again: -t 7.
# Every start goes on where the last one stopped. A task is put back into the queue (exit code 99) when its
# time is nearly over (s_rt), when its host fails, and while the shard is in use elsewhere. Where the
# dataset cannot be written, it waits in the error state for `qmod -cj` (exit code 100).
#$ -cwd
#$ -j y
#$ -r y
#$ -notify
#$ -pe smp 8
#$ -l s_rt=03:58:00,h_rt=04:00:00
#$ -S /bin/bash
set -u
usage='usage: qsub -t 1-SHARDS gridengine_job.sh JOB OUTPUT SHARDS'
job=${1:?$usage}
output=${2:?$usage}
shards=${3:?$usage}
if [[ $SGE_TASK_ID == undefined ]]; then echo "$usage" >&2; exit 2; fi

# Grid Engine announces an end with USR1 (s_rt) or USR2 (qdel, -notify) to every process of the task;
# diorama's word for it is TERM.
(trap '' USR1 USR2 && exec diorama run "$job" --output "$output" --resume --threads "$NSLOTS" \
  --shard "$SGE_TASK_ID/$shards") &
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
