"""Pages for the browser: templates, styles and scripts, and libraries of others in `vendor`, written into the page."""
