"""The package as ament builds it; `pomona` itself is installed by pip, into the Python that ROS runs."""

from setuptools import setup

setup(
    name="pomona_localizer",
    version="0.1.0",
    packages=["pomona_localizer"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/pomona_localizer"]),
        ("share/pomona_localizer", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    license="Apache-2.0",
    entry_points={"console_scripts": ["localizer = pomona_localizer.node:main"]},
)
