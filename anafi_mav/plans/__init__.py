"""Flight plans: one neutral `Plan` (`plan`), its file formats (`files`) and what of it these cannot hold (`Loss`)."""
