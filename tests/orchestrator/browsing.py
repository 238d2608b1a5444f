"""Open a page of results in a browser, as its reader does."""

PATIENCE = 120_000  # [ms]


def opened(browser, url, troubles, **settings):
    """Open a page and wait until all is drawn; list what it complains about and what it asks for."""
    page = browser.new_page(**settings)
    page.on("console", lambda message: message.type == "error" and troubles.append(message.text))
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.on("request", lambda request: request.url.startswith("http") and troubles.append(request.url))
    page.goto(url)
    page.wait_for_selector("body[data-ready]", state="attached", timeout=PATIENCE)
    return page
