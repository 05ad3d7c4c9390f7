"""The browser's side: the server of pages and API, and the 3-D scene.

The pages are plain modules without a build step (`web_assets/js`, whose README says how they are made).
"""
