"""b1 as a process: `python -m dispatch.b1 --help`."""

from dispatch.bidder.process import run

if __name__ == "__main__":
    run("b1", "velma1")
