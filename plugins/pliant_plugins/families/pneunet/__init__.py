"""A fast PneuNet: a row of thin-walled chambers on a strain-limiting layer."""
