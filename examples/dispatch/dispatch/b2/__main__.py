"""b2 as a process: `python -m dispatch.b2 --help`."""

from dispatch.bidder.process import run

if __name__ == "__main__":
    run("b2", "velma2")
