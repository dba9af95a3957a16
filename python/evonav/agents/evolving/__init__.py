"""EvolvingNav's filter: a posterior over sites and the unknown, with soft negative evidence."""
