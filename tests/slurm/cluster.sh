#!/bin/sh
# A Slurm cluster of two nodes on this machine, in a folder of its own: plans a bake, submits what `--slurm` wrote, has one
# unit requeued while it runs, and waits for the merge.
#
#     tests/slurm/cluster.sh RELIGHT SCENE FOLDER [OPTIONS OF bake]
#
# Writes FOLDER/farm.relight. Exit code 77: Slurm is not installed, or does not start here.
set -eu
program=$1 scene=$2 dir=$3
shift 3
PATH=$PATH:/usr/sbin:/sbin
for tool in munged slurmctld slurmd sbatch; do
    command -v $tool >/dev/null || { echo "$tool is not installed (Debian: slurm-wlm, munge)" >&2; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo "slurmd must be started by root" >&2; exit 77; }

mkdir -p "$dir/munge" "$dir/state" "$dir/log"
chmod 700 "$dir/munge"
dd if=/dev/urandom of="$dir/munge/key" bs=1024 count=1 2>/dev/null
chmod 400 "$dir/munge/key"
base=$((20000 + $$ % 20000))
cat >"$dir/slurm.conf" <<CONF
ClusterName=relight
SlurmctldHost=localhost(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$dir/munge/socket
SlurmctldPort=$base
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool.%n
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.%n.pid
SlurmctldLogFile=$dir/log/slurmctld
SlurmdLogFile=$dir/log/slurmd.%n
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_min_interval=0,batch_sched_delay=0
MpiDefault=none
ReturnToService=2
MailProg=/bin/true
NodeName=n[1-2] NodeHostname=localhost NodeAddr=127.0.0.1 Port=[$((base + 1))-$((base + 2))] CPUs=1 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
# Nothing is confined here; older versions know no `disabled`, and use no cgroups unless a plugin asks for them.
case $(slurmd -V) in
*\ 2[0-2].*) echo 'CgroupPlugin=cgroup/v1' ;;
*) echo 'CgroupPlugin=disabled' ;;
esac >"$dir/cgroup.conf"
export SLURM_CONF="$dir/slurm.conf"

started=
stop() {
    scancel --full -u root 2>/dev/null || true
    for pid in $started; do kill "$pid" 2>/dev/null || true; done
    for pid in $started; do wait "$pid" 2>/dev/null || true; done
}
trap stop EXIT
daemon() {
    "$@" >"$dir/log/$(basename "$1").out" 2>&1 &
    started="$! $started"
}
daemon munged --foreground --force --key-file="$dir/munge/key" --socket="$dir/munge/socket" \
    --pid-file="$dir/munge/pid" --log-file="$dir/munge/log" --seed-file="$dir/munge/seed"
sleep 1
daemon slurmctld -D -f "$SLURM_CONF"
daemon slurmd -D -f "$SLURM_CONF" -N n1
daemon slurmd -D -f "$SLURM_CONF" -N n2
tries=0
until [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = 2 ]; do
    tries=$((tries + 1))
    if [ $tries -gt 60 ]; then
        echo "Slurm does not start here:" >&2
        tail -n 5 "$dir"/log/* >&2
        exit 77
    fi
    sleep 0.5
done
echo "two nodes are up: $(sinfo --version)" >&2

"$program" bake "$scene" -o "$dir/farm.relight" "$@" --plan "$dir/a plan" --slurm -q
merge=$("$dir/a plan/slurm/submit.sh" --partition=all)
# A unit is taken off its node while it runs, as when a node is needed for something else: once it has said something, since
# Slurm may count a job that is requeued while it is still being launched as failed.
tries=0
while :; do
    running=$(squeue -h -r -t R -n relight-units -o %i | head -n 1)
    if [ -s "$dir/a plan/slurm/unit-${running#*_}.log" ] && scontrol requeue "$running" 2>/dev/null; then
        echo "requeued $running" >&2
        break
    fi
    tries=$((tries + 1))
    [ $tries -lt 100 ] || { echo "no unit was seen running" >&2; exit 1; }
    sleep 0.1
done
# A requeued job waits for its begin time, some two minutes, so that no late word of its first run is taken for the end of the
# second. Here it has some seconds, and nobody else wants the node.
sleep 5
tries=0
while [ -n "$(squeue -h -o %i)" ]; do
    for job in $(squeue -h -r -t PD -n relight-units -o %i); do
        scontrol update JobId="$job" StartTime=now 2>/dev/null || true
    done
    tries=$((tries + 1))
    if [ $tries -gt 600 ]; then
        squeue >&2
        cat "$dir/a plan/slurm/"*.log >&2
        exit 1
    fi
    sleep 0.5
done
scontrol show job "$merge" | grep JobState >&2 || true
if [ ! -s "$dir/farm.relight" ]; then
    tail -n 20 "$dir/a plan/slurm/"*.log >&2 || true
    tail -n 60 "$dir/log/slurmctld" >&2
    exit 1
fi
cat "$dir/a plan/slurm/merge.log" >&2
