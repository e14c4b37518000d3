"""Materials, their calibration, and the forms built from them; knows neither `app` nor `geometry`."""
