"""What names one host is replaced by pseudonyms, stand-ins and ordinals before it is committed."""
