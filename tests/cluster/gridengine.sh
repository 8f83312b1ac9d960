# SPDX-License-Identifier: Apache-2.0
# Grid Engine for run.sh: a master and one host, in a cell of their own.

install_gridengine() {
  if command -v sge_qmaster sge_execd qsub >/dev/null; then return; fi
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
    gridengine-master gridengine-exec gridengine-client >/dev/null
}

start_gridengine() {
  local place=$work/ge
  export SGE_ROOT=$place/root SGE_CELL=default SGE_QMASTER_PORT=26444 SGE_EXECD_PORT=26445
  mkdir -p "$place"/root/default/common "$place"/spool/{spooldb,qmaster/job_scripts,execd}
  ln -s /var/lib/gridengine/{bin,lib,util,utilbin} "$place/root/"
  echo localhost >"$place/root/default/common/act_qmaster"
  echo "localhost $(hostname)" >"$place/root/default/common/host_aliases"
  sed "s,/var/spool/gridengine,$place/spool," /usr/share/gridengine/default-bootstrap \
    >"$place/root/default/common/bootstrap"
  chown -R sgeadmin: "$place"
  {
    su -s /bin/sh sgeadmin -c "/usr/share/gridengine/scripts/init_cluster $place/root default $place/spool/spooldb sgeadmin"
    sge_qmaster
    wait_until 30 qconf -sh
    qconf -as localhost
    # Root's tasks are wanted here, the PATH of this test, and short times.
    qconf -sconf | sed "s,^execd_spool_dir.*,execd_spool_dir $place/spool/execd,
      s,^\(min_[ug]id\).*,\1 0,;s,^load_report_time.*,load_report_time 00:00:02,;s,^login_shells.*,login_shells csh," >"$place/global"
    qconf -Mconf "$place/global"
    qconf -ssconf | sed 's,^schedule_interval.*,schedule_interval 0:0:2,
      s,^\(flush_[a-z]*_sec\).*,\1 1,' >"$place/scheduler"
    qconf -Msconf "$place/scheduler"
    printf '%s\n' 'group_name @allhosts' 'hostlist localhost' >"$place/hosts"
    qconf -Ahgrp "$place/hosts"
    printf '%s\n' 'pe_name smp' 'slots 999' 'user_lists NONE' 'xuser_lists NONE' 'start_proc_args NONE' \
      'stop_proc_args NONE' 'allocation_rule $pe_slots' 'control_slaves FALSE' 'job_is_first_task TRUE' \
      'urgency_slots min' 'accounting_summary FALSE' 'qsort_args NONE' >"$place/smp"
    qconf -Ap "$place/smp"
    qconf -sq | sed 's,^qname.*,qname all.q,;s,^hostlist.*,hostlist @allhosts,;s,^slots.*,slots 16,
      s,^pe_list.*,pe_list smp,;s,^load_thresholds.*,load_thresholds NONE,;s,^notify.*,notify 00:00:20,' \
      >"$place/queue"
    qconf -Aq "$place/queue"
    sge_execd
  } >"$work/log/gridengine" 2>&1
  wait_until 30 host_is_there || { say 'Grid Engine does not start'; tail "$work/log/gridengine"; exit 1; }
  say "$(qstat -help | head -n 1): $(qhost | tail -n 1)"
}
host_is_there() { qhost | grep -q '^localhost.*lx-amd64.*G '; }

stop_gridengine() {
  stop_daemons "$work"/ge/spool/{execd/localhost/execd.pid,qmaster/qmaster.pid}
}

# enqueue ARRAY SHARDS [SECONDS]: as the template's usage line, with less of a host. Sets id.
enqueue() {
  id=$(qsub -terse -t "$1" -pe smp 1 -v PATH="$PATH" -o "$work/log" \
    packaging/cluster/gridengine_job.sh "$job" "$data" "${@:2}")
  id=${id%%.*}
}
gridengine_over() { ! qstat -j "$id" >/dev/null 2>&1; }
# complete SECONDS CODE: waits for all tasks; the last run of each must have ended with that code.
complete() {
  if ! wait_until "$1" gridengine_over; then
    fault "not over: $(qstat | tail -n +3 | head -n 3)"
    qdel -f "$id" >/dev/null
    wait_until 30 gridengine_over || true
    return
  fi
  # The books are written every 15 seconds.
  wait_until 40 last_codes_are "$2" || fault "ended with $(last_codes), expected $2"
}
last_codes() {
  qacct -j "$id" 2>/dev/null | awk '$1 == "taskid" {task = $2} $1 == "exit_status" {last[task] = $2}
    END {for (task in last) print last[task]}' | sort -u | tr '\n' ' '
}
last_codes_are() { [[ $(last_codes) == "$1 " ]]; }
requeued() { qacct -j "$id" | grep -c 'rescheduling' || true; }

gridengine_test_array() {
  enqueue 1-4 4
  complete 120 0
  same_as_reference "$data"
}

gridengine_test_one_shard_alone() {
  enqueue 2 4
  complete 60 0
  [[ $(pictures "$data") == $(($(pictures "$work/reference") / 4)) ]] || fault "$(pictures "$data") pictures"
  enqueue 1 4
  complete 60 0
  enqueue 3-4 4
  complete 120 0
  same_as_reference "$data"
}

gridengine_test_auto() {
  delay 20
  enqueue 1-4 auto
  complete 120 0
  same_as_reference "$data"
}

gridengine_test_sixteen_together() {
  local round
  for round in 1 2 3; do
    data=$work/data/$scenario.$round
    enqueue 1-16 16
    complete 240 0
    same_as_reference "$data"
  done
}

gridengine_test_rescheduled_in_mid_run() {
  delay 20
  enqueue 1-4 4
  wait_until 60 has_pictures "$data" 12 || fault 'no pictures'
  qmod -rj "$id.1" "$id.3" >>"$work/log/gridengine" || true
  complete 240 0
  (($(requeued) >= 1)) || fault 'was not rescheduled'
  same_as_reference "$data"
}

# The daemon is gone, its tasks live on; another one takes them over.
gridengine_test_killed_daemon() {
  delay 50
  enqueue 1-4 4
  wait_until 60 has_pictures "$data" 8 || fault 'no pictures'
  kill -KILL "$(cat "$work/ge/spool/execd/localhost/execd.pid")"
  sleep 5
  sge_execd >>"$work/log/gridengine" 2>&1
  complete 240 0
  same_as_reference "$data"
}

gridengine_test_time_limit() {
  delay 100
  enqueue 1-4 4 10
  complete 400 0
  (($(requeued) >= 4)) || fault 'was not requeued'
  say "$scenario: $(requeued) times back into the queue"
  same_as_reference "$data"
}

gridengine_test_full_disk() {
  data=$work/small/dataset_ge
  head -c 100M /dev/zero >"$work/small/filler" 2>/dev/null || true
  enqueue 1-2 2
  wait_until 60 in_error_state || fault "exit code 6 does not wait for qmod: $(qstat | tail -n 1)"
  rm "$work/small/filler"
  qmod -cj "$id" >>"$work/log/gridengine" || true  # ends with 1 in any case
  complete 120 0
  same_as_reference "$data"
}
in_error_state() { qstat | grep -q "^ *$id .* Eqw "; }

gridengine_test_wrong_job() {
  local right=$job
  job=$work/wrong.yaml
  sed 's/^seed:/sede:/' "$right" >"$job"
  enqueue 1-2 2
  complete 60 3
  job=$right
  [[ $(requeued) == 0 ]] || fault 'was tried again'
  [[ ! -e $data ]] || fault 'left a folder'
}

gridengine_test_deleted() {
  delay 50
  enqueue 1-2 2
  wait_until 60 has_pictures "$data" 4 || fault 'no pictures'
  qdel "$id" >>"$work/log/gridengine" || true
  wait_until 60 gridengine_over || fault 'was not deleted'
  sleep 5
  [[ -z $(programs "$data") ]] || fault 'still runs'
  delay 0
  enqueue 1-2 2
  complete 120 0
  same_as_reference "$data"
}
