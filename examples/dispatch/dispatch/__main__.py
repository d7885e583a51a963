"""Router, monitor and agents as processes: `python -m dispatch`; Ctrl-C ends them in order."""

from operate.supervisor import project

if __name__ == "__main__":
    project.run("dispatch.system:SYSTEM")
