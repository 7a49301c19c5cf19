"""How sure labels are: distance statistics, the probability of each identity, and the account of label quality."""
