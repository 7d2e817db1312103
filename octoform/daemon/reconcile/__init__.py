"""The loop: look, judge, try, and see whether it helped; one problem at a time, and each only as often as it may."""
