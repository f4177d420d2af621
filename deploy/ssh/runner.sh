#!/bin/sh
# Runs tasks of an array on a host without a queue, one after the other; as many of these run as tasks may run at a time.
# In its folder: `count` tasks, `script` for each, and what becomes of them. It needs /proc, which tells a process
# from another that later has the same number.
#   runner.sh FOLDER LOG NUMBER [SLOTS]    (LOG with % in the place of a task's number)
# The NUMBERth of its array; of all arrays beside it no more than SLOTS of these run tasks at a time.
cd "$1" || exit 1
log=$2 slot=$3 slots=$4

# Writes the number and start time of process $2 into file $1, whole or not at all.
note() {
    start=$(sed 's/^.*) //' "/proc/$2/stat" | cut -d' ' -f20)
    echo "$2 $start" >"$1.new" && mv "$1.new" "$1"
}

# A signal is for the task that runs: this one stays to write down how it ended.
trap : HUP INT TERM
# Who cannot be found by that must not run.
note "$$.runner" "$$" || exit 1
read -r count <count

# Takes a slot that nobody has, or else waits for the next one a while. A slot is a lock, which goes with whoever holds it, its task
# included. Where there are no locks nobody is kept waiting.
has_slot() {
    tries=0
    while [ "$tries" -le "$slots" ]; do
        tries=$((tries + 1))
        true >>"../slot.$slot" || return 0
        exec 9>>"../slot.$slot"
        if [ "$tries" -le "$slots" ]; then flock -n 9; else flock -w 2 9; fi
        [ $? -eq 1 ] || return 0
        slot=$((slot % slots + 1))
    done
    return 1
}
is_left() { # whether there is a task that nobody has
    task=0
    while [ "$task" -lt "$count" ]; do
        task=$((task + 1))
        [ -d "$task.claim" ] || return 0
    done
    return 1
}
if [ -n "$slots" ] && command -v flock >/dev/null; then
    until has_slot; do
        is_left || break
    done
fi

task=0
while [ "$task" -lt "$count" ]; do
    task=$((task + 1))
    # Whoever makes the folder has the task.
    mkdir "$task.claim" 2>/dev/null || continue
    FLYBY_TASK=$task
    export FLYBY_TASK
    out=$(printf '%s' "$log" | sed "s|%|$task|")
    # A session of its own, so that all of it can be ended, and nothing else.
    setsid sh ./script </dev/null >>"$out" 2>&1 &
    child=$!
    note "$task.pid" "$child" 2>/dev/null
    # Whoever deleted it before it had a number could not end it.
    [ -e "$task.deleted" ] && kill -s TERM -- "-$child" 2>/dev/null
    code=
    while [ -z "$code" ]; do
        wait "$child"
        code=$?
        # A signal ends the waiting, and not the task.
        [ "$code" -gt 128 ] && kill -0 "$child" 2>/dev/null && code=
    done
    echo "$code" >"$task.exit.new" && mv "$task.exit.new" "$task.exit"
done
rm -f "$$.runner"
