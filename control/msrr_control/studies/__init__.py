"""Studies: thousands of unicycle trials of one phase under any law, and the paper's figures of them."""
