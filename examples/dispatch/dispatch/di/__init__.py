"""di. Takes orders of people, puts each out to tender, and awards it to the robot that would have done it soonest."""
