import asyncio, math, sys
sys.path.insert(0,'tests')
from support.world import world
from anafi_mav.mavlink.dialect import *
T=(1,100)
async def test_x():
    for model in sys.argv[1:] or ['4k']: pass
import pytest
@pytest.mark.parametrize("model",["4k","thermal","usa","ai"])
async def test_thin(model):
    async with world(model=model, web=True) as w:
        c=w.client
        a=await c.command(MAV_CMD_REQUEST_MESSAGE,259,target=T); print(a)
        print(await c.wait("CAMERA_INFORMATION",since=0))
        for m in (260,261,262,271,264,265):
            a=await c.command(MAV_CMD_REQUEST_MESSAGE,m,target=T); print(m,a.result)
        for k in ("CAMERA_SETTINGS","STORAGE_INFORMATION","CAMERA_CAPTURE_STATUS","CAMERA_FOV_STATUS"):
            print([str(x[1]) for x in c.since(0,k)])
        a=await c.command(MAV_CMD_SET_CAMERA_MODE,0,0,target=T); print(a)
        m=c.mark()
        a=await c.command(MAV_CMD_IMAGE_START_CAPTURE,0,0,1,0,target=T); print(a)
        print(await c.wait("CAMERA_IMAGE_CAPTURED",since=m))
        a=await c.command(MAV_CMD_SET_CAMERA_MODE,0,1,target=T); print(a)
        a=await c.command(MAV_CMD_VIDEO_START_CAPTURE,0,0,target=T); print(a)
        print(await c.wait("CAMERA_CAPTURE_STATUS",lambda s:s.video_status==1,since=m))
        a=await c.command(MAV_CMD_VIDEO_STOP_CAPTURE,0,0,target=T); print(a)
        print(await c.wait("CAMERA_CAPTURE_STATUS",lambda s:s.video_status==0,since=c.mark()-20))
        m=c.mark()
        a=await c.command(MAV_CMD_STORAGE_FORMAT,1 if model!='ai' else 2,1,target=T); print(a)
        for k in ("STORAGE_INFORMATION","CAMERA_CAPTURE_STATUS","STATUSTEXT"):
            print([str(x[1]) for x in c.since(m,k)])
