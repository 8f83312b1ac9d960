#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A job in shards on a Slurm cluster; each task of the array makes one shard on a file system that all
# nodes share:
#   sbatch --array=1-16 slurm_job.sh configs/dining_room.yaml /scratch/dataset 16
# The last argument is the number of shards, so that one of them can be made again: --array=7.
# `auto` instead of it lets each task take visits until none is left, so that slow nodes hold up nothing.
# `diorama status OUTPUT` says what is missing. Every start goes on where the last one stopped. A task is put
# back into the queue when its time is nearly over, when its node fails or it is preempted, while the shard is
# in use elsewhere, and when the dataset could not be written (20 times); a wrong job ends at once.
# --no-requeue, scancel: never.
#SBATCH --cpus-per-task=8
#SBATCH --mem=8G
#SBATCH --time=04:00:00
#SBATCH --signal=TERM@120
#SBATCH --requeue
#SBATCH --open-mode=append
set -u
usage='usage: sbatch --array=1-SHARDS slurm_job.sh JOB OUTPUT SHARDS'
job=${1:?$usage}
output=${2:?$usage}
shards=${3:?$usage}
task=${SLURM_ARRAY_JOB_ID:?$usage}_$SLURM_ARRAY_TASK_ID

shard=$SLURM_ARRAY_TASK_ID/$shards
if [[ $shards == auto ]]; then shard=auto; fi

# A step of its own: Slurm's signals reach steps, and this shell outlives them.
srun --ntasks=1 --cpus-per-task="$SLURM_CPUS_PER_TASK" \
  diorama run "$job" --output "$output" --resume --threads "$SLURM_CPUS_PER_TASK" \
  --shard "$shard"
code=$?

# Codes: framework/docs/exit_codes.md. 137 and 143: killed, by lack of memory for example.
case $code in
  75 | 130) again=1 ;;
  6 | 137 | 143) again=$((${SLURM_RESTART_COUNT:-0} < 20)) ;;
  *) again=0 ;;
esac
# A task that was cancelled or preempted is no longer running; what becomes of it is settled.
if ((again)) && [[ $(squeue --noheader --jobs="$task" --format="%T %B") == "RUNNING $SLURMD_NODENAME" ]]; then
  echo "exit code $code: back into the queue"
  scontrol requeue "$task"
fi
exit "$code"
