# SPDX-License-Identifier: Apache-2.0
# Slurm for run.sh: a controller and two nodes, each with host name and process numbers of its own.

install_slurm() {
  if command -v slurmctld slurmd munged srun >/dev/null; then return; fi
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
    slurmctld slurmd slurm-client munge >/dev/null
}

start_slurm() {
  local place=$work/slurm node
  mkdir -p "$place"/{munge,state,n1,n2}
  export SLURM_CONF=$place/slurm.conf
  head -c 1024 /dev/urandom >"$place/munge/key"
  chmod 600 "$place/munge/key"
  munged --key-file="$place/munge/key" --socket="$place/munge/socket" --pid-file="$place/munge/pid" \
    --log-file="$place/munge/log" --seed-file="$place/munge/seed"
  # A credential's life is also the least time until a requeued task starts again.
  cat >"$SLURM_CONF" <<-END
	ClusterName=diorama
	SlurmctldHost=$(hostname)(127.0.0.1)
	SlurmctldPort=26817
	SlurmUser=root
	SlurmdUser=root
	AuthInfo=socket=$place/munge/socket,cred_expire=5
	StateSaveLocation=$place/state
	SlurmdSpoolDir=$place/%n
	SlurmctldPidFile=$place/slurmctld.pid
	SlurmdPidFile=$place/%n/slurmd.pid
	SlurmctldLogFile=$work/log/slurmctld
	SlurmdLogFile=$work/log/slurmd.%n
	ProctrackType=proctrack/linuxproc
	TaskPlugin=task/none
	SelectType=select/cons_tres
	SelectTypeParameters=CR_CPU
	MpiDefault=none
	ReturnToService=2
	SlurmdTimeout=10
	KillWait=5
	SchedulerParameters=sched_interval=2,batch_sched_delay=1
	SlurmdParameters=config_overrides
	NodeName=n1 NodeHostname=$(hostname) NodeAddr=127.0.0.1 Port=27001 CPUs=16 RealMemory=16000
	NodeName=n2 NodeHostname=$(hostname) NodeAddr=127.0.0.1 Port=27002 CPUs=16 RealMemory=16000
	PartitionName=all Nodes=n1,n2 Default=YES State=UP
	END
  { cat /etc/hosts; echo '127.0.0.1 n1 n2'; } >"$place/hosts"
  slurmctld
  for node in n1 n2; do start_node "$node"; done
  wait_until 30 idle_nodes 2 || { say "Slurm does not start"; tail -n 20 "$work"/log/slurm*; exit 1; }
  say "$(slurmctld -V): $(sinfo --noheader --format='%D nodes, %T')"
}

# A node is a shell with host name, mounts and process numbers of its own, and a slurmd in it.
start_node() {
  unshare --uts --mount --pid --fork --mount-proc --kill-child sh -c "
    hostname $1
    mount --bind $work/slurm/hosts /etc/hosts
    slurmd -N $1
    while :; do sleep 1; done" >"$work/log/node.$1" 2>&1 &
  eval "node_$1=$!"
}
lose_node() {
  local pid=node_$1
  kill -KILL "${!pid}"
  wait "${!pid}" 2>/dev/null || true
}
kill_daemon() { kill -KILL "$(pgrep -f "^slurmd -N $1\$")"; }
# In a node whose tasks live on.
restart_daemon() {
  local pid=node_$1
  nsenter --target "$(pgrep -P "${!pid}")" --uts --mount --pid slurmd -N "$1"
}
idle_nodes() { [[ $(sinfo --noheader --Node --states=idle,mixed,allocated --responding | wc -l) == "$1" ]]; }

stop_slurm() {
  if [[ ! -d $work/slurm ]]; then return; fi
  local node
  for node in n1 n2; do lose_node "$node" 2>/dev/null || true; done
  stop_daemons "$work"/slurm/{slurmctld.pid,munge/pid}
}

# submit ARRAY SHARDS [OPTION]...: as the template's usage line, with less of a node. Sets id.
submit() {
  id=$(sbatch --parsable --array="$1" --cpus-per-task=1 --mem=100M --output="$work/log/$scenario.%a.out" \
    "${@:3}" packaging/cluster/slurm_job.sh "$job" "$data" "$2")
}
slurm_over() { [[ -z $(squeue --noheader --jobs="$id" 2>/dev/null) ]]; }
# finish SECONDS STATE: waits for all tasks; each must have ended in that state.
finish() {
  if ! wait_until "$1" slurm_over; then
    fault "not over: $(squeue --noheader --jobs="$id" | head -n 3)"
    scancel "$id"
    wait_until 30 slurm_over || true
    return
  fi
  local states
  states=$(scontrol show job "$id" | sed -n 's/.*JobState=\(\S*\).*/\1/p' | sort | uniq -c | tr -s ' \n' ' ')
  if [[ ! $states =~ ^\ [0-9]+\ $2\ $ ]]; then fault "ended as:$states, expected $2"; fi
}
restarts() { scontrol show job "$id" | sed -n 's/.*Restarts=\([0-9]*\).*/\1/p' | sort -n | tail -n 1; }

slurm_test_array() {
  submit 1-4 4
  finish 120 COMPLETED
  same_as_reference "$data"
}

slurm_test_one_shard_alone() {
  submit 2 4
  finish 60 COMPLETED
  [[ $(pictures "$data") == $(($(pictures "$work/reference") / 4)) ]] || fault "$(pictures "$data") pictures"
  submit 1,3,4 4
  finish 120 COMPLETED
  same_as_reference "$data"
}

# Workers that take visits, one of them put back in mid-run.
slurm_test_auto() {
  delay 20
  submit 1-4 auto
  wait_until 60 has_pictures "$data" 12 || fault 'no pictures'
  scontrol requeue "${id}_2"
  finish 180 COMPLETED
  same_as_reference "$data"
}

slurm_test_sixteen_together() {
  local round
  for round in 1 2 3; do
    data=$work/data/$scenario.$round
    submit 1-16 16
    finish 240 COMPLETED
    same_as_reference "$data"
  done
}

slurm_test_requeued_in_mid_run() {
  delay 20
  submit 1-4 4
  wait_until 60 has_pictures "$data" 12 || fault 'no pictures'
  scontrol requeue "${id}_1" "${id}_3"
  finish 180 COMPLETED
  (($(restarts) >= 1)) || fault 'was not requeued'
  same_as_reference "$data"
}

# The daemon is gone, its tasks live on: after SlurmdTimeout the same shards are started on the other node,
# too.
slurm_test_killed_daemon() {
  delay 150
  submit 1-4 4
  wait_until 60 has_pictures "$data" 8 || fault 'no pictures'
  local first pid alive=0
  first=$(programs "$data")
  kill_daemon n1
  wait_until 90 runs_on n2 || fault 'no task was started on the other node'
  for pid in $first; do
    if ! gone "$pid"; then alive=$((alive + 1)); fi
  done
  ((alive == 4)) || fault "$alive of 4 tasks lived on"
  finish 400 COMPLETED
  restart_daemon n1
  wait_until 60 idle_nodes 2 || fault 'the node did not come back'
  say "$scenario: $alive shards ran twice, up to $(restarts) restarts"
  same_as_reference "$data"
}
runs_on() { squeue --noheader --jobs="$id" --nodelist="$1" --states=RUNNING | grep -q .; }

# The owner's host cannot be asked whether it lives: its lease must run out.
slurm_test_lost_node() {
  delay 50 --lease-timeout 20
  submit 1-4 4
  wait_until 60 has_pictures "$data" 8 || fault 'no pictures'
  lose_node n1
  finish 240 COMPLETED
  (($(restarts) >= 1)) || fault 'was not requeued'
  start_node n1
  wait_until 60 idle_nodes 2 || fault 'the node did not come back'
  same_as_reference "$data"
}

# A minute is the least that Slurm has; a shard takes longer.
slurm_test_time_limit() {
  delay 200
  submit 1-4 4 --time=1 --signal=TERM@40
  finish 500 COMPLETED
  (($(restarts) >= 1)) || fault 'was not requeued'
  say "$scenario: up to $(restarts) restarts"
  same_as_reference "$data"
}

slurm_test_full_disk() {
  data=$work/small/dataset
  head -c 100M /dev/zero >"$work/small/filler" 2>/dev/null || true
  submit 1-2 2
  wait_until 60 grep -qs 'exit code 6: back into the queue' "$work/log/$scenario.1.out" ||
    fault "exit code 6 was not requeued: $(tail -n 2 "$work/log/$scenario.1.out")"
  rm "$work/small/filler"
  finish 120 COMPLETED
  same_as_reference "$data"
}

slurm_test_wrong_job() {
  local right=$job
  job=$work/wrong.yaml
  sed 's/^seed:/sede:/' "$right" >"$job"
  submit 1-2 2
  finish 60 FAILED
  job=$right
  [[ $(restarts) == 0 ]] || fault 'was tried again'
  [[ ! -e $data ]] || fault 'left a folder'
}

slurm_test_cancelled() {
  delay 50
  submit 1-2 2
  wait_until 60 has_pictures "$data" 4 || fault 'no pictures'
  scancel "$id"
  finish 60 CANCELLED
  sleep 10
  slurm_over || fault 'came back'
  delay 0
  submit 1-2 2
  finish 120 COMPLETED
  same_as_reference "$data"
}
