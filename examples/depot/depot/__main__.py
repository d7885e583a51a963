"""Router and agents as processes: `python -m depot`; Ctrl-C ends them in order."""

from operate.supervisor import project

from depot.languages import LANGUAGES

AGENTS = ("desk", "dispatcher", "traffic", "mule", "ox")

if __name__ == "__main__":
    project.run("depot", AGENTS, LANGUAGES)
