"""`mdstopo fit`: numbers of a case from measurements, with exact derivatives, intervals, and what cannot be known."""
