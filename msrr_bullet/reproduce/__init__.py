"""The reproduction of the paper: its two experiments on unicycles and in the real loop, and the report."""
