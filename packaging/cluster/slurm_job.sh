#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A job in shards on a Slurm cluster; every shard may be started again and goes on where it stopped.
#   sbatch --array=1-16 slurm_job.sh configs/dining_room.yaml /scratch/dataset
#SBATCH --cpus-per-task=8
#SBATCH --mem=8G
#SBATCH --requeue
set -euo pipefail
job=${1:?usage: sbatch --array=1-N slurm_job.sh JOB OUTPUT}
output=${2:?usage: sbatch --array=1-N slurm_job.sh JOB OUTPUT}
exec diorama run "$job" --output "$output" --threads "$SLURM_CPUS_PER_TASK" --resume \
  --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
