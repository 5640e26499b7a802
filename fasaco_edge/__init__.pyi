from fasaco_edge.config.robot import RobotConfig as Robot
from fasaco_edge.offline.maps import Map as Map
from fasaco_edge.offline.maps import load_map as load_map
from fasaco_edge.offline.passes import plan_passes as plan_passes
from fasaco_edge.offline.plan import plan as plan
from fasaco_edge.offline.result import Plan as Plan
from fasaco_edge.offline.settings import Search as Search

__version__: str
__all__ = ["Map", "Plan", "Robot", "Search", "__version__", "load_map", "plan", "plan_passes"]
