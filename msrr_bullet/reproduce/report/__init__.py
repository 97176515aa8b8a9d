"""The report of a reproduction: findings in words, figures, and the HTML page that holds both."""
