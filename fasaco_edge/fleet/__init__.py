"""A fleet from outside: what its robots tell, for those that record or watch all of them."""
