"""The fleet's router (operate.router)."""

from operate.router.__main__ import main

if __name__ == "__main__":
    main()
