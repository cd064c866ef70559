"""What a ground station expects of any vehicle: identity, banner, time, shell, tunes."""
