"""What the simulation's things are known as to agents."""

# Kinds of the simulated scene (velma.model.scene.Model) -> names of companion.models, where they differ.
KNOWN_AS = {"bowl": "bowl_high", "cabinet": "cabinet_no_door"}
