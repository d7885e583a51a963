"""Build the library of the hot loops."""

from velma.compiled import LIBRARY

if __name__ == "__main__":
    LIBRARY.main()
