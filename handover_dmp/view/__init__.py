"""Looking at a recorded handover: video, animated image, page with a time slider."""
