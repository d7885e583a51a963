"""Build the library of the explorer's loop."""

from topdown.prove.compiled import LIBRARY

if __name__ == "__main__":
    LIBRARY.main()
