import numpy as np, sys
from pathlib import Path
from twinmill.data.importers.import_log import ImportOptions, import_log
D=Path('/work/shared/data')
f=D/'turbopi_optitrack_straight'
import_log(f/'poses.csv', f/'commands.csv', Path('turbopi.lcmlog'), options=ImportOptions(heading_offset_rad=np.pi))
