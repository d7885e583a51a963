"""a_traffic. Lets one robot at a time into the aisle."""
