"""The ground station's side of the mission protocol: against the gateway's own mission_protocol, and against scripted
vehicles."""

from __future__ import annotations

from typing import Any

import pytest
from support.plan_wire import FENCE, Wire, an_item, items, mission_protocol, peer

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.plan_client import (
    ITEM_TIMEOUT,
    ITEM_TRIES,
    MAX_ITEMS,
    TIMEOUT,
    TRIES,
    Build,
    Download,
    Outcome,
    Transfer,
    TransferResult,
    Upload,
)
from anafi_mav.services.plan.item_messages import item_float, item_int, item_of
from anafi_mav.vehicle.fence.plan_items import PlanItem


def builds(plan: tuple[PlanItem, ...]) -> list[Build]:
    return [lambda seq, item=item: item_int(item, seq, 1, 1, FENCE) for item in plan]  # type: ignore[misc]


class Station:
    """A transfer as a client of `plan_wire.Wire`."""

    def __init__(self, transfer: Upload | Download) -> None:
        self.transfer, self.peer = transfer, peer()
        self.sent = 0

    @property
    def done(self) -> bool:
        return self.transfer.result is not None

    def start(self) -> list[Any]:
        return self.transfer.start(0.0)

    def receive(self, message: Any, now: float) -> list[Any]:
        answers = self.transfer.receive(message, 1, 1, now)
        self.sent += len(answers)
        return answers

    def deadline(self) -> float:
        deadline = self.transfer.deadline()
        return 1e9 if deadline is None else deadline

    def expire(self, now: float) -> list[Any]:
        return self.transfer.expire(now)


def run(transfer: Upload | Download, plans: Any, **trouble: Any) -> Wire:
    station = Station(transfer)
    wire = Wire(plans, [station], **trouble)  # type: ignore[list-item]
    wire.to_protocol(station, station.start())  # type: ignore[arg-type]
    wire.run()
    return wire


def test_plan_is_uploaded_and_downloaded() -> None:
    plans = mission_protocol()
    upload = Upload(builds(items(5)), 1, 1, FENCE)
    run(upload, plans)
    assert (upload.result, upload.done, upload.total) == (TransferResult(Outcome.DONE), 5, 5)
    assert plans.transfers[FENCE].items == items(5)
    download = Download(1, 1, FENCE)
    wire = run(download, plans)
    assert download.result == TransferResult(Outcome.DONE)
    assert tuple(item_of(message) for message in download.items) == items(5)
    assert [type(message).__name__ for message in wire.sent].count("MAVLink_mission_item_int_message") == 5


def test_an_empty_plan() -> None:
    plans = mission_protocol()
    run(Upload(builds(items(3)), 1, 1, FENCE), plans)
    clear = Upload([], 1, 1, FENCE)
    run(clear, plans)
    assert clear.result == TransferResult(Outcome.DONE)
    download = Download(1, 1, FENCE)
    run(download, plans)
    assert (download.result, download.items) == (TransferResult(Outcome.DONE), [])


def test_refusal_names_its_reason() -> None:
    plans = mission_protocol()
    upload = Upload(builds((*items(3), an_item(3, 666), an_item(4))), 1, 1, FENCE)
    run(upload, plans)
    assert upload.result == TransferResult(Outcome.REFUSED, dialect.MAV_MISSION_UNSUPPORTED)
    assert upload.result.reason == "UNSUPPORTED"
    assert plans.transfers[FENCE].items == ()


@pytest.mark.parametrize("seed", range(8))
def test_a_quarter_lost_each_way(seed: int) -> None:
    """500 items, up and down; messages come twice and out of order, too."""
    plans = mission_protocol()
    upload = Upload(builds(items(500)), 1, 1, FENCE)
    run(upload, plans, loss=0.25, duplicate=0.05, delay=(0.005, 0.06), seed=seed)
    # The last word may be lost as often as it is said; that the vehicle has the plan is then found out by asking.
    assert upload.result is not None
    assert upload.result.outcome in (Outcome.DONE, Outcome.UNCONFIRMED)
    assert plans.transfers[FENCE].items == items(500)
    download = Download(1, 1, FENCE)
    run(download, plans, loss=0.25, duplicate=0.05, delay=(0.005, 0.06), seed=seed)
    assert download.result == TransferResult(Outcome.DONE)
    assert tuple(item_of(message) for message in download.items) == items(500)


# Scripted vehicles.


def through_silence(transfer: Transfer | Any, now: float) -> list[tuple[float, str]]:
    """What is sent until it gives up."""
    sent: list[tuple[float, str]] = []
    while (deadline := transfer.deadline()) is not None:
        now = deadline
        assert transfer.expire(now - 0.001) == []
        sent += [(round(now, 3), message.get_type()) for message in transfer.expire(now)]
    return sent


def test_silent_vehicle_ends_the_transfer() -> None:
    upload = Upload(builds(items(2)), 1, 1, FENCE)
    (first,) = upload.start(10.0)
    assert (first.get_type(), first.count, first.mission_type) == ("MISSION_COUNT", 2, FENCE)
    assert through_silence(upload, 10.0) == [(10.0 + TIMEOUT * n, "MISSION_COUNT") for n in range(1, TRIES)]
    assert upload.result == TransferResult(Outcome.SILENT)
    download = Download(1, 1, FENCE)
    download.start(10.0)
    assert len(through_silence(download, 10.0)) == TRIES - 1
    assert download.result == TransferResult(Outcome.SILENT)


def test_download_from_a_vehicle_falling_silent_fails() -> None:
    download = Download(1, 1, FENCE)
    download.start(0.0)
    (request,) = download.receive(dialect.MAVLink_mission_count_message(255, 190, 3, FENCE), 1, 1, 1.0)
    assert (request.get_type(), request.seq) == ("MISSION_REQUEST_INT", 0)
    asked = through_silence(download, 1.0)
    assert asked == [(1.0 + ITEM_TIMEOUT * n, "MISSION_REQUEST_INT") for n in range(1, ITEM_TRIES)]
    assert download.result == TransferResult(Outcome.SILENT)


def test_vehicle_without_acknowledgement_ends_the_transfer() -> None:
    upload = Upload(builds(items(1)), 1, 1, FENCE)
    upload.start(0.0)
    (item,) = upload.receive(dialect.MAVLink_mission_request_message(255, 190, 0, FENCE), 1, 1, 0.1)
    assert item.get_type() == "MISSION_ITEM_INT"
    said = through_silence(upload, 0.1)
    assert said == [(round(0.1 + TIMEOUT * n, 3), "MISSION_ITEM_INT") for n in range(1, TRIES)]
    assert upload.result == TransferResult(Outcome.UNCONFIRMED)


def test_messages_of_other_transfers_are_ignored() -> None:
    upload = Upload(builds(items(2)), 1, 1, FENCE)
    upload.start(0.0)
    request = dialect.MAVLink_mission_request_int_message(255, 190, 0, FENCE)
    assert upload.receive(request, 2, 1, 0.1) == []
    assert upload.receive(request, 1, 154, 0.1) == []
    assert upload.receive(dialect.MAVLink_mission_request_int_message(255, 190, 0, 0), 1, 1, 0.1) == []
    assert upload.receive(dialect.MAVLink_mission_request_int_message(255, 190, 2, FENCE), 1, 1, 0.1) == []
    assert upload.receive(dialect.MAVLink_mission_ack_message(255, 190, 0, FENCE), 1, 1, 0.1) == []
    assert upload.receive(dialect.MAVLink_mission_ack_message(255, 190, 13, FENCE), 1, 1, 0.1) == []
    assert upload.receive(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3), 1, 1, 0.1) == []
    assert upload.result is None
    assert upload.done == 0


def test_a_list_without_bounds() -> None:
    download = Download(1, 1, FENCE)
    download.start(0.0)
    (ack,) = download.receive(dialect.MAVLink_mission_count_message(255, 190, MAX_ITEMS + 1, FENCE), 1, 1, 0.1)
    assert (ack.get_type(), ack.type) == ("MISSION_ACK", dialect.MAV_MISSION_NO_SPACE)
    assert download.result == TransferResult(Outcome.TOO_MANY)


def test_items_in_the_older_form_and_out_of_turn() -> None:
    download = Download(1, 1, FENCE)
    download.start(0.0)
    download.receive(dialect.MAVLink_mission_count_message(255, 190, 2, FENCE), 1, 1, 0.1)
    assert download.receive(item_float(an_item(1), 1, 255, 190, FENCE), 1, 1, 0.2) == []
    (request,) = download.receive(item_float(an_item(0), 0, 255, 190, FENCE), 1, 1, 0.3)
    assert request.seq == 1
    assert download.receive(item_int(an_item(0), 0, 255, 190, FENCE), 1, 1, 0.4) == []
    (ack,) = download.receive(item_int(an_item(1), 1, 255, 190, FENCE), 1, 1, 0.5)
    assert (ack.get_type(), ack.type) == ("MISSION_ACK", dialect.MAV_MISSION_ACCEPTED)
    assert [message.seq for message in download.items] == [0, 1]


def test_refused_download_names_the_reason() -> None:
    download = Download(1, 1, FENCE)
    download.start(0.0)
    assert download.receive(dialect.MAVLink_mission_ack_message(255, 190, 3, FENCE), 1, 1, 0.1) == []
    assert download.result == TransferResult(Outcome.REFUSED, dialect.MAV_MISSION_UNSUPPORTED)


def test_cancelled_transfer_sends_operation_cancelled_once() -> None:
    for transfer in (Upload(builds(items(2)), 1, 1, FENCE), Download(1, 1, FENCE)):
        transfer.start(0.0)
        (ack,) = transfer.cancel()
        assert (ack.type, ack.mission_type) == (dialect.MAV_MISSION_OPERATION_CANCELLED, FENCE)
        assert transfer.cancel() == []
