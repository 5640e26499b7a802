"""Lattice rotation: conversion between the map frame and the frame in which a mission plans.

All messages are given in the map frame. Cells are aligned with the axes of the mission's frame,
which has the same origin: maps, poses and places are rotated on input, paths on output. At zero
rotation values are unchanged bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import msgspec

from fasaco_edge.grid.geometry import GridGeometry, Point, Pose2D, StampedPose, Window
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rotation import (
    rotated_geometry,
    rotated_point,
    rotated_points,
    rotated_polygon,
    rotated_pose,
)
from fasaco_edge.mission.config import MissionConfig, Place
from fasaco_edge.mission.coverage.loop_closure import Motion, moved_mask
from fasaco_edge.mission.events import (
    Event,
    FollowerBlocked,
    MapReceived,
    MemberReceived,
    PathUpdate,
    PoseReceived,
    PriorityReceived,
)
from fasaco_edge.mission.map.placing import rotated_order
from fasaco_edge.mission.orders.mask import mask_polygons
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.mission.work.reached_cells import ReachedCells

_AnyPlace = TypeVar("_AnyPlace", bound=Place)


@dataclass(frozen=True, slots=True)
class LatticeRotation:
    """A lattice with its rows at an angle to the x axis of the map frame.

    Attributes:
        deg: the angle [deg].
    """

    deg: float = 0.0

    def config(self, config: MissionConfig) -> MissionConfig:
        """Return a mission's configuration in the mission's frame; ``given`` stays as is."""
        policy = config.policy
        if self.deg:
            polygons = policy.keep_out + mask_polygons(policy.keep_out_mask)
            policy = msgspec.structs.replace(
                policy,
                keep_out=tuple(rotated_polygon(polygon, -self.deg) for polygon in polygons),
                keep_out_mask="",
                home=self._place(policy.home),
                dock=self._place(policy.dock),
            )
        return replace(config, policy=policy, lattice_deg=self.deg, given=config.policy)

    def event(self, event: Event) -> Event:
        """Return an event in the mission's frame; an order is rotated once its map is known."""
        if not self.deg:
            return event
        match event:
            case MapReceived(grid=grid) | PriorityReceived(grid=grid):
                return replace(event, grid=_rotated_grid(grid, -self.deg))
            case PoseReceived(pose, at):
                return PoseReceived(_rotated_stamped(pose, -self.deg), at)
            case MemberReceived(x=x, y=y):
                x, y = rotated_point(x, y, -self.deg)
                ahead = tuple(rotated_point(*point, -self.deg) for point in event.ahead)
                return replace(event, x=x, y=y, ahead=ahead)
            case FollowerBlocked(x=x, y=y):
                x, y = rotated_point(x, y, -self.deg)
                points = tuple(rotated_point(*point, -self.deg) for point in event.points)
                return replace(event, x=x, y=y, points=points)
        return event

    def order(self, state: OrderState, rotated_by_deg: float, scale: float) -> OrderState:
        """Return an order in the mission's frame.

        Args:
            state: the order; its polygons may be rotated already.
            rotated_by_deg: rotation of the lattice since home was noted [deg].
            scale: edge of a cell, as a multiple of the edge when home was noted.
        """
        order = None if state.order is None else rotated_order(state.order, -self.deg)
        home, reached = state.home, state.reached
        if not rotated_by_deg and scale == 1.0:
            return replace(state, order=order)
        if home is not None:
            x, y = rotated_point(home[1] + 0.5, home[0] + 0.5, -rotated_by_deg)
            home = math.floor(y / scale), math.floor(x / scale)
        if reached is not None:
            reached = _relaid_reached(reached, -rotated_by_deg, scale)
        return replace(state, order=order, home=home, reached=reached)

    def path(self, update: PathUpdate, lattice: CoverageLattice | None) -> PathUpdate:
        """Return a path in the map frame, as published."""
        if not self.deg or lattice is None:
            return update
        xy = lattice.centres(update.cells) if update.xy is None else update.xy
        yaw = update.end_yaw
        yaw = None if yaw is None else math.remainder(yaw + math.radians(self.deg), math.tau)
        yaws = None if update.yaw is None else update.yaw + math.radians(self.deg)
        return replace(update, xy=rotated_points(xy, self.deg), end_yaw=yaw, yaw=yaws)

    def grid(self, grid: OccupancyGrid | None) -> OccupancyGrid | None:
        """Return a map of the mission in the map frame."""
        return grid if grid is None or not self.deg else _rotated_grid(grid, self.deg)

    def pose(self, stamped: StampedPose | None) -> StampedPose | None:
        """Return a pose of the mission in the map frame."""
        return stamped if stamped is None or not self.deg else _rotated_stamped(stamped, self.deg)

    def cells(self, window: Window, cell_m: float) -> GridGeometry:
        """Return the placement of a window of cells, ``cell_m`` [m] wide, in the map frame."""
        return self.geometry(GridGeometry.of_cells(window, cell_m))

    def geometry(self, geometry: GridGeometry) -> GridGeometry:
        """Return the placement of a grid of the mission in the map frame."""
        return rotated_geometry(geometry, self.deg) if self.deg else geometry

    def centre(self, cell: Cell, cell_m: float) -> Point:
        """Return the centre (x, y) [m] of a cell, ``cell_m`` [m] wide, in the map frame."""
        x, y = (cell[1] + 0.5) * cell_m, (cell[0] + 0.5) * cell_m
        return rotated_point(x, y, self.deg) if self.deg else (x, y)

    def _place(self, place: _AnyPlace | None) -> _AnyPlace | None:
        if place is None:
            return None
        x, y = rotated_point(place.x_m, place.y_m, -self.deg)
        yaw_deg = math.remainder(place.yaw_deg - self.deg, 360.0)
        return msgspec.structs.replace(place, x_m=x, y_m=y, yaw_deg=yaw_deg)


def _rotated_grid(grid: OccupancyGrid, by_deg: float) -> OccupancyGrid:
    return replace(grid, geometry=rotated_geometry(grid.geometry, by_deg))


def _relaid_reached(reached: ReachedCells, by_deg: float, scale: float) -> ReachedCells | None:
    turn = Motion(Pose2D(0.0, 0.0), Pose2D(0.0, 0.0, math.radians(by_deg)))
    moved = moved_mask(reached.window, reached.mask, turn, 1.0, scale)
    found = None if moved is None else ReachedCells.of(moved[1], moved[0])
    return None if found is None else msgspec.structs.replace(found, have_moved=True)


def _rotated_stamped(stamped: StampedPose, by_deg: float) -> StampedPose:
    return replace(stamped, pose=rotated_pose(stamped.pose, by_deg))
