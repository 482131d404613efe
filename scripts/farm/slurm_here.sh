#!/usr/bin/env bash
# Runs a command in a Slurm of its own: one machine, one node, no systemd, nothing of it left behind.
#   slurm_here.sh COMMAND…
# Root and the packages slurm-wlm and munge are needed; no other Slurm or munge may be running.
set -euo pipefail
home=$(mktemp -d /tmp/apr-slurm.XXXXXX)
chmod 755 "$home"
daemons=()
stop() {
    for ((i = ${#daemons[@]} - 1; i >= 0; i--)); do
        kill "${daemons[i]}" 2>/dev/null || true
        wait "${daemons[i]}" 2>/dev/null || true
    done
    rm -rf "$home"
}
trap stop EXIT
host=$(hostname -s)
mkdir "$home/state" "$home/spool" "$home/munge"
dd if=/dev/urandom of="$home/munge/key" bs=1024 count=1 status=none
chmod 700 "$home/munge"
chmod 400 "$home/munge/key"
chown -R munge: "$home/munge"
socket=$home/socket/munge
mkdir "$home/socket"
chown munge: "$home/socket"
cat >"$home/slurm.conf" <<CONF
ClusterName=here
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$socket
CryptoType=crypto/munge
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation=$home/state
SlurmdSpoolDir=$home/spool
SlurmctldPidFile=$home/slurmctld.pid
SlurmdPidFile=$home/slurmd.pid
SlurmctldLogFile=$home/slurmctld.log
SlurmdLogFile=$home/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_min_interval=0
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$home/slurm.conf
setpriv --reuid=munge --regid=munge --clear-groups munged --foreground --socket="$socket" \
    --key-file="$home/munge/key" --pid-file="$home/socket/pid" --log-file="$home/socket/log" \
    --seed-file="$home/socket/seed" &
daemons+=($!)
for _ in {1..50}; do [ -S "$socket" ] && break; sleep 0.1; done
slurmctld -D &
daemons+=($!)
slurmd -D -f "$SLURM_CONF" &
daemons+=($!)
for _ in {1..100}; do
    [ "$(sinfo -h -o %t 2>/dev/null)" = idle ] && break
    sleep 0.2
done
[ "$(sinfo -h -o %t)" = idle ] || { tail -n 20 "$home"/*.log >&2; exit 1; }
"$@" || { code=$?; tail -n 20 "$home"/*.log >&2; exit $code; }
