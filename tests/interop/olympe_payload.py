"""Camera, gimbal, card and media, against Parrot's Olympe alone. Knows nothing of this project."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

from olympe_base import LIMIT, Visit, plain  # isort: skip
from olympe.features.media import (
    delete_all_media,
    delete_media,
    download_media,
    download_media_thumbnail,
    indexing_state,
    media_created,
    resource_created,
)
from olympe.messages import camera, camera2, common, gimbal, mediastore, thermal, user_storage, user_storage_v2
from olympe.messages.common import CalibrationState


def attempt(call: Callable[[], object]) -> str:
    """What it came to, or what Olympe stumbled over."""
    try:
        return repr(call())
    except NameError as error:
        return f"NameError: {error}"


class Payload(Visit):
    folder: Path
    """Where downloads go."""

    # -- the older cameras

    def set_camera(self) -> None:
        furthest = 32.0 if self.model == "usa" else 3.0
        self.expect("ev", camera.set_ev_compensation(0, "ev_1_00"))
        self.expect("white balance", camera.set_white_balance(0, "custom", "t_5500"))
        self.expect("antiflicker", camera.set_antiflicker_mode("mode_60hz"))
        self.expect("hdr", camera.set_hdr_setting(0, "active"))
        self.expect("style", camera.set_style(0, "standard"))
        self.expect("style parameters", camera.set_style_params(0, 1, -1, 2))
        self.expect("zoom speed", camera.set_max_zoom_speed(0, 2.0))
        self.expect("zoom quality", camera.set_zoom_velocity_quality_degradation(0, 1))
        self.expect("zoom", camera.set_zoom_target(0, "level", 2.0) & camera.zoom_level(cam_id=0, level=2.0))
        self.expect("zoom in", camera.set_zoom_target(0, "velocity", 1.0) & camera.zoom_level(cam_id=0, level=furthest))
        self.expect("zoom back", camera.reset_zoom(0) & camera.zoom_level(cam_id=0, level=1.0))
        self.expect("streaming", camera.set_streaming_mode(0, "high_reliability"))
        self.expect("autorecord", camera.set_autorecord(0, "inactive"))
        if self.model == "4k":
            wanted = ("automatic", "shutter_1_over_60", "iso_100", "iso_800", "standard")
        else:
            wanted = ("manual", "shutter_1_over_500", "iso_400", "iso_3200", "standard")
        self.expect("exposure", camera.set_exposure_settings(0, *wanted))
        self.result["exposure"] = plain(dict(self.drone.get_state(camera.exposure_settings)[0]))

    def take_photos(self) -> None:
        self.expect("photo mode", camera.set_camera_mode(0, "photo"))
        single = ("single", "rectilinear", "jpeg", "burst_14_over_1s", "preset_1ev", 0.0)
        self.expect("single", camera.set_photo_mode(0, *single))
        self.photo("photo")
        self.expect("burst", camera.set_photo_mode(0, "burst", *single[1:]))
        self.photo("photos of a burst")
        lapse = ("time_lapse", *single[1:5], 2.0)
        self.expect("time lapse", camera.set_photo_mode(0, *lapse))
        saved = camera.photo_progress(result="photo_saved", _policy="wait")
        self.expect("start a lapse", camera.take_photo(0) & saved)
        self.expect("stop the lapse", camera.stop_photo(0))
        self.expect("too early a photo", camera.set_camera_mode(0, "recording"))
        bad = camera.photo_progress(result="error_bad_state", _policy="wait", _timeout=LIMIT)
        self.expect("no photo while recording is set", camera.take_photo(0, _no_expect=True) & bad)

    def photo(self, name: str) -> None:
        """From the button to the file, on the drone's link and on its websocket."""
        observed = self.drone.media(media_created(_timeout=LIMIT))
        # The first shot's file comes with its media; only those after it are reported by themselves.
        files = self.drone.media(resource_created(_timeout=LIMIT)) if "burst" in name else observed
        saved = self.drone(camera.photo_progress(result="photo_saved", _policy="wait", _timeout=LIMIT))
        idle = camera.photo_state(cam_id=0, state="inactive", _policy="wait", _timeout=LIMIT)
        self.expect(name, camera.take_photo(0) >> idle)
        ok = all(self.heard(one) for one in (saved, observed, files))
        self.say(f"{name}, reported", ok)
        self.result[name] = saved.received_events().last().args["media_id"] if ok else None

    def record(self) -> None:
        standard = ("standard", "res_1080p", "fps_30", "ratio_15")
        self.expect("recording mode", camera.set_recording_mode(0, *standard))
        self.expect("start recording", camera.start_recording(0))
        self.result["recording"] = self.state_of(camera.recording_state)
        self.pan()
        self.expect("stop recording", camera.stop_recording(0))

    # -- the Ai's camera

    def use_camera2(self) -> None:
        command, event = camera2.Command, camera2.Event

        def configure(name: str, **config: object) -> None:
            self.expect(name, command.Configure(camera_id=0, config=camera2.Config(**config)))

        configure("photo mode", camera_mode="photo", photo_mode="single", photo_file_format="jpeg")
        configure("settings", ev_compensation="1_00", white_balance_mode="sunny", image_style="plog")
        done = event.Photo(type="stop", stop_reason="capture_done", _policy="wait", _timeout=LIMIT)
        observed = self.drone.media(media_created(_timeout=LIMIT))
        self.expect("photo", command.StartPhoto(camera_id=0) & done)
        self.say("photo, reported", self.heard(observed))
        configure("burst", photo_mode="burst", photo_burst_value="14_over_1s")
        done = event.Photo(type="stop", stop_reason="capture_done", _policy="wait", _timeout=LIMIT)
        self.expect("photos of a burst", command.StartPhoto(camera_id=0) & done)
        configure("time lapse", photo_mode="time_lapse", photo_time_lapse_interval=1.0)
        next_one = event.NextPhotoInterval(camera_id=0, _policy="wait", _timeout=LIMIT)
        self.expect("start a lapse", command.StartPhoto(camera_id=0) & next_one)
        stopped = event.Photo(type="stop", stop_reason="user_request", _policy="wait", _timeout=LIMIT)
        self.expect("stop the lapse", command.StopPhoto(camera_id=0) & stopped)
        configure("recording mode", camera_mode="recording", video_recording_resolution="1080p")
        began = event.Recording(type="start", _policy="wait", _timeout=LIMIT)
        self.expect("start recording", command.StartRecording(camera_id=0) & began)
        self.pan()
        ended = event.Recording(type="stop", stop_reason="user_request", _policy="wait", _timeout=LIMIT)
        self.expect("stop recording", command.StopRecording(camera_id=0) & ended)
        level = event.ZoomLevel(camera_id=0, level=2.0, _policy="wait", _timeout=LIMIT)
        self.expect("zoom", command.SetZoomTarget(camera_id=0, control_mode="level", target=2.0) & level)
        state = self.drone.get_state(event.State)[0]
        self.result["config"] = {name: plain(state["config"][name]) for name in ("camera_mode", "ev_compensation")}

    def look(self, name: str, pitch: float, speed: float) -> None:
        """Up or down, at so many degrees per second; until it looks there."""
        self.expect(f"{name}: speed", gimbal.set_max_speed(0, 30.0, speed, 30.0))
        target = gimbal.set_target(0, "position", "none", 0.0, "absolute", pitch, "none", 0.0)
        self.expect(name, target & gimbal.attitude(gimbal_id=0, pitch_absolute=pitch, _policy="wait"))

    def pan(self) -> None:
        """Something to film: two seconds of it."""
        self.look("pan down", -60.0, 30.0)

    def look_around(self) -> None:
        self.look("gimbal down", -45.0, 90.0)

        def at(pitch: float) -> object:
            return gimbal.attitude(gimbal_id=0, pitch_absolute=pitch, _policy="wait")

        turn = gimbal.set_target(0, "velocity", "none", 0.0, "absolute", 0.5, "none", 0.0)
        self.expect("gimbal up at a speed", turn & at(90.0 if self.model != "ai" else 176.0))
        self.expect("gimbal reset", gimbal.reset_orientation(0) & at(0.0))
        self.expect("offsets", gimbal.start_offsets_update(0))
        self.expect("an offset", gimbal.set_offsets(0, 0.0, 1.5, -1.5))
        self.expect("offsets end", gimbal.stop_offsets_update(0))
        done = gimbal.calibration_result(gimbal_id=0, result="success", _policy="wait", _timeout=LIMIT)
        self.expect("calibrate", gimbal.calibrate(0) >> done)
        self.result["offsets"] = self.state_of(gimbal.offsets)
        self.result["axes"] = str(self.drone.get_state(gimbal.gimbal_capabilities)[0]["axes"])

    def calibrate_compass(self) -> None:
        """As a person turns the drone about each axis, in Olympe's words; all is asked for beforehand."""
        wait = {"_policy": "wait", "_timeout": LIMIT}
        turned = {
            axis: self.drone(CalibrationState.MagnetoCalibrationAxisToCalibrateChanged(axis=axis, **wait))
            for axis in ("xAxis", "yAxis", "zAxis", "none")
        }
        done = CalibrationState.MagnetoCalibrationStateChanged(1, 1, 1, 0, **wait)
        over = self.drone(done >> CalibrationState.MagnetoCalibrationStartedChanged(started=0, **wait))
        self.expect("calibrate the compass", common.Calibration.MagnetoCalibration(1, _timeout=LIMIT))
        for axis, scheduled in turned.items():
            self.say(f"axis to calibrate: {axis}", self.heard(scheduled))
        self.say("compass calibrated", self.heard(over))

    def see_warmth(self) -> None:
        self.expect("blended", thermal.set_mode("blended"))
        self.expect("rendering", thermal.set_rendering("blended", 0.25))
        self.expect("emissivity", thermal.set_emissivity(0.5))
        self.expect("background", thermal.set_background_temperature(300.0))
        self.expect("sensitivity", thermal.set_sensitivity("high"))
        self.expect("shutter", thermal.set_shutter_mode("manual"))
        palette = ("absolute", 280.0, 310.0, "limited", "locked", "hot", 0.5)
        self.expect("palette", thermal.set_palette_settings(*palette))
        self.expect("start a thermal film", camera.start_recording(2))
        self.expect("something to film", gimbal.attitude(gimbal_id=0, _policy="wait"))
        self.expect("stop the thermal film", camera.stop_recording(2))
        self.expect("visible again", thermal.set_mode("disabled"))
        self.expect("the first camera again", camera.camera_states(active_cameras=1, _policy="check_wait"))

    # -- media

    def fetch(self) -> None:
        media = self.drone.media
        media.download_dir = str(self.folder)
        media.integrity_check = True
        self.ask("index", indexing_state("indexed"))
        listed = media.list_media()
        self.result["media"] = {id: plain(media.media_info(id)._asdict()) for id in listed}
        for id in listed:
            self.download(f"download {id}", partial(download_media, id, integrity_check=True))
        self.download("thumbnails of a burst", partial(download_media_thumbnail, "10000002"))
        files = [file for file in sorted(self.folder.iterdir()) if file.suffix in (".JPG", ".DNG", ".MP4")]
        self.result["files"] = {file.name: hashlib.md5(file.read_bytes()).hexdigest() for file in files}
        self.result["thumbnails"] = sorted(file.name for file in (self.folder / "thumbnails").glob("*.JPG"))
        self.result["counters"] = self.state(mediastore.counters)
        if listed:
            # Either is over with the drone's word that they are removed, which takes them off Olympe's list too.
            self.ask("delete one", delete_media(listed[0]))
            self.say("it is gone", listed[0] not in media.list_media())
        self.ask("delete all", delete_all_media())
        self.say("all are gone", media.list_media() == [])
        gone = mediastore.counters(photo_media_count=0, video_media_count=0, _policy="check_wait", _timeout=LIMIT)
        self.expect("and not counted", gone)

    def download(self, name: str, media: Callable[[], object]) -> None:
        """It gives the machine's own disk two seconds, which a busy machine may need for a burst: up to three times."""
        with self.step(name) as entry:
            for _ in range(3):
                if self._wait(entry, self.drone.media(media())):
                    return

    def format(self) -> None:
        if self.model == "ai":
            self.expect("monitor", user_storage_v2.start_monitoring(1, 1))
            self.expect("format", user_storage_v2.format_with_type(1, "films", "quick"))
        else:
            self.expect("monitor", user_storage.start_monitoring(1))
            self.expect("format", user_storage.format_with_type("films", "full"))
            self.result["card"] = self.state(user_storage.info)
            self.result["free"] = self.state(user_storage.monitor)
        self.ask("index again", indexing_state("indexed"))

    def plans(self) -> None:
        file = b"QGC WPL 120\n0\t0\t3\t22\t0\t0\t0\t0\t48.88\t2.36\t10\t1\n"
        plans = self.drone.flightplan
        self.result["plan"] = plans.upload(file)
        self.result["plans"] = attempt(plans.download_all)
        self.result["plan again"] = attempt(lambda: plans.download(self.result["plan"]))

    def use_payload(self, folder: Path) -> None:
        self.begin("payload")
        self.folder = folder
        if self.model == "ai":
            self.use_camera2()
        else:
            self.set_camera()
            self.take_photos()
            self.record()
        if self.model in ("thermal", "usa"):
            self.see_warmth()
        self.look_around()
        self.calibrate_compass()
        self.fetch()
        self.format()
        self.plans()
