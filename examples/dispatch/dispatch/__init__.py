"""dispatch: people order tasks, and the robot companion that would have done one soonest does it."""
