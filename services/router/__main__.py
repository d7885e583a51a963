"""The fleet's router (operate.router)."""

from operate.router import main

if __name__ == "__main__":
    main()
