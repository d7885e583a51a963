"""The supervisor: starts, watches and restarts the processes of the embedded default (`roco up`).
Not an agent.
"""
