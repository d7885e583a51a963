"""a_desk. Takes orders of people, one after the other, and tells what became of them."""
