"""The process that serves: started, ended, recorded, supervised by systemd, and stopped by a person."""
