"""What executors' workers are asked to do."""

import os
import signal
import sys
import time


def double(chunk):
    return [2 * x for x in chunk]


def misfortune(chunk):
    done.append(chunk)
    match chunk[0]:
        case "raise":
            raise ValueError("this chunk is bad")
        case "exit":
            os._exit(3)
        case "leave":
            os._exit(0)  # as a library does that calls C's exit
        case "system exit":
            sys.exit("enough")
        case "unreadable":
            raise Unreadable("a", "b")
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            time.sleep(60)
        case "no room":
            raise OSError(28, "No space left on device", "/somewhere")
        case "spoilt" if len(done) > 1:  # the second chunk of a process
            raise FileNotFoundError(2, "No such file or directory")
    return chunk


done = []


class Unreadable(Exception):
    """Like many: it can be written into a pipe, and not be read from it."""

    def __init__(self, one, other):
        super().__init__(f"{one} and {other}")
