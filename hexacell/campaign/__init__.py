"""What a campaign does next and what it will give: points, budget, forecasts, decisions."""
