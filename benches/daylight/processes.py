"""Programs and the processor time they take."""

import resource
import subprocess


class Failed(Exception):
    """A program that ended with an error, and what it said."""


def seconds():
    """CPU seconds, user and system, of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def pipeline(commands, cwd=None, env=None, out=None):
    """Runs commands, each one's output the next one's input. CPU seconds of all."""
    before, running, before_it = seconds(), [], None
    for command in commands:
        last = command is commands[-1]
        process = subprocess.Popen(
            command,
            cwd=cwd,
            env=env,
            stdin=before_it,
            stdout=out if last else subprocess.PIPE,
            stderr=subprocess.PIPE if last else subprocess.DEVNULL,
        )
        if before_it:
            before_it.close()
        before_it = process.stdout
        running.append(process)
    said = running[-1].communicate()[1].decode(errors="replace")
    for process in running[:-1]:
        process.wait()
    for command, process in zip(commands, running):
        if process.returncode:
            raise Failed(f"{' '.join(command)}: exit code {process.returncode}\n{said}")
    return seconds() - before
